"""What the game of sunset_game.py is drawn with besides fans: shaders, and meshes turned on a lathe."""

import numpy as np

# By the time of day: elevation of the sun in degrees; light of the sun, the moon and the sky, linear; sRGB of the sky.
SKY = np.array(
    [
        # time  sun   sunlight          moonlight         ambient           zenith            horizon
        [0.00, 24, 1.55, 1.36, 1.02, 0.00, 0.00, 0.00, 0.27, 0.33, 0.42, 0.27, 0.47, 0.78, 0.80, 0.87, 0.90],
        [0.40, 11, 1.75, 1.10, 0.56, 0.00, 0.00, 0.00, 0.23, 0.25, 0.35, 0.27, 0.38, 0.66, 0.98, 0.80, 0.58],
        [0.62, 4, 1.60, 0.66, 0.22, 0.00, 0.00, 0.00, 0.17, 0.17, 0.29, 0.21, 0.24, 0.50, 1.00, 0.58, 0.33],
        [0.74, 0, 0.00, 0.00, 0.00, 0.01, 0.02, 0.03, 0.12, 0.12, 0.22, 0.12, 0.14, 0.34, 0.82, 0.40, 0.34],
        [0.85, -5, 0.0, 0.00, 0.00, 0.10, 0.15, 0.26, 0.06, 0.08, 0.16, 0.05, 0.07, 0.20, 0.36, 0.27, 0.38],
        [1.00, -11, 0.0, 0.00, 0.00, 0.20, 0.29, 0.50, 0.04, 0.06, 0.13, 0.02, 0.04, 0.12, 0.11, 0.17, 0.31],
    ]
)

SHARED = """#version 330
uniform vec3 sun, sunlight, moon, moonlight, back, backlight, ambient, zenith, horizon, eye;
uniform vec3 lamps[3];
uniform float night, time;
float hash(vec2 p) { return fract(sin(dot(p, vec2(127.1, 311.7))) * 43758.5453); }
float noise(vec2 p) {
    vec2 i = floor(p), f = fract(p), u = f * f * (3.0 - 2.0 * f);
    return mix(mix(hash(i), hash(i + vec2(1, 0)), u.x), mix(hash(i + vec2(0, 1)), hash(i + 1.0), u.x), u.y);
}
vec3 srgb(vec3 c) {
    return mix(c * 12.92, 1.055 * pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}
vec3 light(vec3 n, float lit) {
    vec3 direct = sunlight * max(dot(n, sun), 0.0) + moonlight * max(dot(n, moon), 0.0);
    return ambient + backlight * max(dot(n, back), 0.0) + lit * direct;
}
vec3 lamplight(vec3 at, vec3 n) {
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 3; i++) {
        vec3 to = lamps[i] - at;
        sum += vec3(1.0, 0.55, 0.18) * (0.12 + 0.88 * max(dot(n, normalize(to)), 0.0)) / (0.5 + dot(to, to));
    }
    return sum * (0.2 + 1.1 * night);
}
vec3 sky(vec3 ray) {
    float up = max(ray.y, 0.0), toward = max(dot(ray, sun), 0.0), day = 1.0 - night;
    vec3 c = mix(horizon, zenith, pow(up, 0.42));
    c += day * (vec3(0.30, 0.17, 0.05) * pow(toward, 8.0) + vec3(0.5, 0.4, 0.25) * pow(toward, 160.0));
    return c;
}
"""
SKY_VERTEX = "#version 330\nin vec2 at; out vec2 v_at; void main() { v_at = at; gl_Position = vec4(at, 0.0, 1.0); }"
SKY_FRAGMENT = """
in vec2 v_at; out vec4 color;
uniform mat4 world_from_clip;
void main() {
    vec4 far = world_from_clip * vec4(v_at, 1.0, 1.0);
    vec3 ray = normalize(far.xyz / far.w - eye);
    vec3 c = sky(ray);
    float day = 1.0 - night, toward = max(dot(ray, sun), 0.0);
    c += smoothstep(0.99945, 0.9996, dot(ray, sun)) * vec3(1.0, 0.9, 0.6) * day;
    float disc = smoothstep(0.99925, 0.9994, dot(ray, moon)), shade = noise(ray.xy * 90.0);
    c = mix(c, vec3(0.93, 0.94, 0.88) * (0.82 + 0.2 * shade), disc * night);
    c += night * vec3(0.10, 0.13, 0.2) * pow(max(dot(ray, moon), 0.0), 60.0);
    vec2 around = vec2(atan(ray.x, ray.z), ray.y), cell = floor(around * vec2(70.0, 90.0));
    vec2 star = fract(around * vec2(70.0, 90.0)) - 0.2 - 0.6 * vec2(hash(cell), hash(cell + 7.0));
    float bright = step(0.86, hash(cell + 3.0)) * smoothstep(0.10, 0.0, length(star));
    c += night * night * bright * smoothstep(0.05, 0.4, ray.y) * (0.6 + 0.4 * sin(3.0 * time + 40.0 * hash(cell)));
    // Clouds, and two ranges of hills on the horizon.
    vec2 level = normalize(ray.xz), over = ray.xz / (max(ray.y, 0.0) + 0.12) * vec2(0.6, 1.5) + 0.01 * time;
    float cloud = smoothstep(0.50, 0.80, noise(over) * 0.55 + 0.3 * noise(over * 2.7) + 0.15 * noise(over * 7.0));
    cloud *= smoothstep(0.03, 0.16, ray.y);
    c = mix(c, mix(horizon, vec3(1.0), 0.45 * day) + 0.25 * day * pow(toward, 6.0), 0.5 * cloud * (0.25 + 0.75 * day));
    for (int i = 2; i > 0; i--) {
        float k = float(i), rough = 0.3 * noise(level * (17.0 * k)) + 0.12 * noise(level * 60.0);
        float hill = 0.012 * k + 0.06 * (0.7 * noise(level * (2.3 + 2.0 * k) + 9.0 * k) + rough);
        vec3 haze = mix(zenith * 0.6, sky(vec3(ray.x, 0.0, ray.z)), 0.25 + 0.22 * k);
        c = mix(c, haze, smoothstep(hill, hill - 0.002, ray.y));
    }
    color = vec4(c + (hash(gl_FragCoord.xy) - 0.5) / 128.0, 1.0);
}"""
MESH_VERTEX = """#version 330
uniform mat4 clip_from_world, world_from_mesh;
in vec3 position, normal; in vec4 paint;
out vec3 world, facing; out vec4 v_paint;
void main() {
    world = (world_from_mesh * vec4(position, 1.0)).xyz;
    facing = mat3(world_from_mesh) * normal;
    v_paint = paint;
    gl_Position = clip_from_world * vec4(world, 1.0);
}"""
MESH_FRAGMENT = """
in vec3 world, facing; in vec4 v_paint; out vec4 color;
void main() {
    vec3 n = normalize(facing), c = v_paint.rgb * (light(n, 1.0) + lamplight(world, n));
    color = vec4(srgb(mix(c, v_paint.rgb * 1.4, v_paint.a * (0.55 + 0.45 * night))), 1.0);
}"""
GROUND_FRAGMENT = """
uniform float lit;
in vec3 world, facing; in vec4 v_paint; out vec4 color;
void main() {
    vec2 p = world.xz;
    float far = length(world - eye), coarse = noise(p * 0.13), middle = noise(p * 0.9), fine = noise(p * 9.0);
    vec3 albedo = mix(vec3(0.085, 0.135, 0.035), vec3(0.16, 0.175, 0.06), coarse) * (0.62 + 0.5 * middle);
    albedo *= 1.0 + (fine - 0.5) * 0.7 * smoothstep(30.0, 4.0, far);
    float bend = 3.0 * sin(p.y * 0.13), path = abs(p.x - bend) + 1.1 * (noise(p * 0.8) - 0.5);
    vec3 earth = vec3(0.25, 0.19, 0.125) * (0.7 + 0.45 * noise(p * 3.0) + 0.2 * (fine - 0.5));
    albedo = mix(earth, albedo, smoothstep(0.9, 1.5, path));
    vec3 up = vec3(0.0, 1.0, 0.0), c = srgb(albedo * (light(up, lit) + lamplight(world, up)));
    color = vec4(mix(c, sky(normalize(world - eye) * vec3(1, 0, 1)), smoothstep(45.0, 190.0, far)), 1.0);
}"""
GLOW_VERTEX = """#version 330
uniform mat4 clip_from_world;
uniform vec3 right, up;
in vec2 corner; in vec4 at;
out vec2 v_corner;
void main() {
    v_corner = corner;
    gl_Position = clip_from_world * vec4(at.xyz + at.w * (corner.x * right + corner.y * up), 1.0);
}"""
GLOW_FRAGMENT = """
in vec2 v_corner; out vec4 color;
void main() {
    float reach = max(1.0 - length(v_corner), 0.0);
    color = vec4(vec3(1.0, 0.58, 0.20) * (0.55 * pow(reach, 2.5) + 0.5 * pow(reach, 9.0)) * (0.3 + 0.7 * night), 0.0);
}"""
CORNERS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], "f4")


def lathe(profile, color, sides=12, glow=0.0, stretch=(1.0, 1.0), folds=0.0):
    """A turned shape: triangles (N, 10) of position, normal, linear colour and glow.

    `profile` is (radius, height) upward; `folds` is how deep, at the foot, the folds of a cloth are.
    """
    radius, height = np.array(profile, float).T
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    around = np.stack([np.sin(turn) * stretch[0], 0 * turn, np.cos(turn) * stretch[1]], axis=-1)
    along = np.stack([np.cos(turn), 0 * turn, -np.sin(turn)], axis=-1)
    depth = folds * np.linspace(1, 0, len(radius))[:, None, None]
    wave, slant = np.cos(9 * turn)[:, None], 9 * np.sin(9 * turn)[:, None]
    points = radius[:, None, None] * around * (1 + depth * wave) + height[:, None, None] * [0, 1, 0]
    slope = np.gradient(radius) / np.maximum(np.abs(np.gradient(height)), 1e-3)
    normals = around + depth * slant * along - slope[:, None, None] * [0, 1, 0]
    rows = np.concatenate([points, normals, np.broadcast_to([*color, glow], (*points.shape[:2], 4))], axis=-1)
    a, b, c, d = rows[:-1, :-1], rows[:-1, 1:], rows[1:, :-1], rows[1:, 1:]
    return np.stack([a, b, c, c, b, d], axis=2).reshape(-1, 10)


def moved(rows, x=0.0, y=0.0, z=0.0):
    """The same triangles in another place."""
    return rows + np.array([x, y, z, 0, 0, 0, 0, 0, 0, 0])


CLOAK, HOOD, SKIN = (0.27, 0.035, 0.035), (0.21, 0.025, 0.03), (0.62, 0.38, 0.25)
BOOT, BRASS, PAPER = (0.05, 0.035, 0.03), (0.25, 0.17, 0.05), (1.0, 0.62, 0.22)
SLEEVE = lathe([(0.0, 0.76), (0.085, 0.76), (0.09, 0.9), (0.085, 1.1), (0.07, 1.24), (0.0, 1.3)], CLOAK)
CAPE = [(0.43, 0.24), (0.39, 0.45), (0.33, 0.75), (0.27, 1.0), (0.25, 1.2), (0.19, 1.32), (0.08, 1.4), (0.0, 1.41)]
BODY = np.concatenate(
    [
        lathe(CAPE, CLOAK, 72, stretch=(1, 0.8), folds=0.07),
        lathe([(0.0, 1.36), (0.13, 1.42), (0.155, 1.53), (0.13, 1.64), (0.0, 1.69)], SKIN),
        moved(
            lathe([(0.21, 1.33), (0.205, 1.5), (0.18, 1.63), (0.10, 1.74), (0.03, 1.84), (0.0, 1.87)], HOOD), z=-0.05
        ),
        moved(SLEEVE, x=0.285, z=0.1),
        moved(SLEEVE, x=-0.285),
    ]
)
LEG = lathe([(0.0, -0.42), (0.10, -0.42), (0.09, -0.3), (0.10, 0.0), (0.0, 0.05)], BOOT, 8, stretch=(1, 1.5))
LANTERN = np.concatenate(
    [
        lathe([(0.0, -0.18), (0.13, -0.18), (0.13, -0.14), (0.10, -0.13)], BRASS, 6),
        lathe([(0.10, -0.13), (0.115, 0.0), (0.10, 0.13)], PAPER, 6, glow=1.0),
        lathe([(0.16, 0.12), (0.14, 0.15), (0.05, 0.25), (0.03, 0.26), (0.03, 0.31), (0.0, 0.31)], BRASS, 6),
    ]
)

# A plane that follows nobody: its colours are worked out from the place, and it ends in the haze.
GROUND_VERTICES = np.hstack(
    [
        np.array([[-1, 0, 1], [1, 0, 1], [-1, 0, -1], [-1, 0, -1], [1, 0, 1], [1, 0, -1]]) * 380.0,
        np.tile([0, 1, 0, 0, 0, 0, 0], (6, 1)),
    ]
)


def tuft(blades=34, seed=2):
    """Positions, triangles, normals and sRGB colours of a tuft of grass with a few flowers."""
    rng = np.random.default_rng(seed)
    points, normals, colors, faces = [], [], [], []
    for blade in range(blades):
        turn, lean, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 0.42), rng.uniform(0.22, 0.55)
        out = np.array([np.sin(turn), 0, np.cos(turn)])
        side = np.array([np.cos(turn), 0, -np.sin(turn)]) * rng.uniform(0.008, 0.015)
        foot = out * rng.uniform(0, 0.16)
        middle, tip = foot + out * lean * 0.3 + [0, height * 0.6, 0], foot + out * lean * 0.8 + [0, height, 0]
        start = len(points)
        points += [foot - side, foot + side, middle - side * 0.8, middle + side * 0.8, tip]
        normals += [out * 0.4 + [0, 0.9, 0]] * 5
        green = np.array([92, 118, 46]) * rng.uniform(0.75, 1.2) + [rng.uniform(0, 34), 0, 0]
        colors += [green * 0.62] * 2 + [green * 0.98] * 2 + [green * 1.3]
        faces += [(start, start + 1, start + 2), (start + 2, start + 1, start + 3), (start + 2, start + 3, start + 4)]
        if blade % 9 == 0:
            start, petal = len(points), rng.choice([0, 1])
            for k in range(4):
                points.append(
                    tip + 0.028 * (np.cos(k * np.pi / 2) * side / 0.011 + np.sin(k * np.pi / 2) * np.array([0, 1, 0]))
                )
            normals += [[0, 1, 0]] * 4
            colors += [np.array([[250, 244, 226], [236, 178, 64]][petal])] * 4
            faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    colors = np.hstack([np.clip(colors, 0, 255), np.full((len(colors), 1), 255)]).astype(np.uint8)
    return np.array(points), np.array(faces), np.array(normals), colors


TUFT = tuft()
SHADERS = {
    "sky": (SKY_VERTEX, SHARED + SKY_FRAGMENT),
    "mesh": (MESH_VERTEX, SHARED + MESH_FRAGMENT),
    "ground": (MESH_VERTEX, SHARED + GROUND_FRAGMENT),
    "glow": (GLOW_VERTEX, SHARED + GLOW_FRAGMENT),
}
