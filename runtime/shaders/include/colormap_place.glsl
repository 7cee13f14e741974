// Where a fan stands in its rooms.
// One row for each of the colormap's: the view's centre in the world and the instance's scale; the rooms' parts in the
// diffuse light; 1 for the room that is mirrored; the view.
uniform sampler2D places;

vec4 place_at(int column, int row) {
    return texelFetch(places, ivec2(column, row), 0);
}
