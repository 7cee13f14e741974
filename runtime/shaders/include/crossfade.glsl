// Which pixels of a crossfade show this fan, view or mesh; what it fades to or from shows others. The pattern is made of
// integers, so that two programs find exactly the same: the R2 sequence of M. Roberts, "The Unreasonable Effectiveness
// of Quasirandom Sequences" (2018), in 32-bit fractions. Not Bayer's, which transparent materials are dithered with.
flat in vec2 v_part;  // of the dither, from and to

bool keeps_pixel() {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uint rank = (pixel.x * 3242174889u + pixel.y * 2447445414u) >> 24;
    float at = (float(rank) + 0.5) / 256.0;
    return at >= v_part.x && at < v_part.y;
}
