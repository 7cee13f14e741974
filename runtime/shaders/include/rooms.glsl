// Rooms: light that reaches a point of the world. Equals impostor.environment.room and impostor.environment.blending.
const int MAX_ROOMS = 4;
const int ROWS = 9;
uniform vec4 rooms[MAX_ROOMS * ROWS];  // as runtime.rooms.environments packs them
const float WALL = 1e-4;  // of the half size: what stands on a wall is inside
const float EDGE = 0.1;   // as impostor.environment.blending has it

struct Room {
    vec4 x, y, z;              // rows of room_from_world
    vec4 captured_at;          // w: 0 far, 1 sphere, 2 box, 3 absent
    vec4 environment_scale;    // from room space; w: exposure
    vec4 right, up, back;      // rows of environment_from_world; w: the colour outside
    vec4 environment;          // as environment.glsl reads it
};

Room room_at(int i) {
    i *= ROWS;
    return Room(rooms[i], rooms[i + 1], rooms[i + 2], rooms[i + 3], rooms[i + 4], rooms[i + 5], rooms[i + 6], rooms[i + 7],
                rooms[i + 8]);
}

vec3 in_room(Room room, vec3 point) {
    vec4 p = vec4(point, 1.0);
    return vec3(dot(room.x, p), dot(room.y, p), dot(room.z, p));
}

bool is_far(Room room) {
    return room.captured_at.w < 0.5;
}

bool is_sphere(Room room) {
    return room.captured_at.w < 1.5;
}

float largest(vec3 sizes) {
    return max(max(sizes.x, sizes.y), sizes.z);
}

bool within(Room room, vec3 local) {
    return is_far(room) || (is_sphere(room) ? length(local) : largest(abs(local))) <= 1.0 + WALL;
}

vec3 environment_normal(Room room, vec3 normal) {
    return vec3(dot(room.right.xyz, normal), dot(room.up.xyz, normal), dot(room.back.xyz, normal));
}

// Where in the environment to look for what a ray in room space meets; any direction for a point outside.
vec3 local_toward(Room room, vec3 start, vec3 along, out bool inside) {
    inside = within(room, start);
    start = inside ? start : vec3(0.0);
    float half_b = dot(start, along), c = dot(start, start) - 1.0;
    float to_sphere = sqrt(max(half_b * half_b - c, 0.0)) - half_b;
    vec3 sizes = abs(along);
    vec3 slabs = mix((1.0 - start * sign(along)) / max(sizes, 1e-12), vec3(1e30), lessThan(sizes, vec3(1e-12)));
    float reach = is_sphere(room) ? to_sphere : min(min(slabs.x, slabs.y), slabs.z);
    vec3 met = start + reach * along - room.captured_at.xyz;
    // A camera on the wall itself sees nothing of the point it touches.
    met = largest(abs(met)) > 1e-6 ? met : along;
    return met * room.environment_scale.xyz;
}

// The same in the world.
vec3 direction_toward(Room room, vec3 point, vec3 direction, out bool inside) {
    vec3 along = vec3(dot(room.x.xyz, direction), dot(room.y.xyz, direction), dot(room.z.xyz, direction));
    vec3 toward = local_toward(room, in_room(room, point), normalize(along), inside);
    return is_far(room) ? environment_normal(room, direction) : toward;
}

vec3 diffuse_in(Room room, vec3 normal) {
    return room.environment_scale.w * diffuse_light_around(room.environment, environment_normal(room, normal));
}

// What a mirror at a point shows; `part` of it, and the colour outside whole.
vec3 mirrored_in(Room room, vec3 point, vec3 direction, float roughness, float part) {
    bool inside;
    vec3 toward = direction_toward(room, point, direction, inside);
    vec3 light = light_around(room.environment, toward, roughness, footprint_of(toward));
    return inside ? part * room.environment_scale.w * light : vec3(room.right.w, room.up.w, room.back.w);
}

// 1 inside a room, 0 well beyond its walls, and of one that is far or absent.
float claim_of(Room room, vec3 local) {
    vec3 depth = is_sphere(room) ? vec3(1.0 + EDGE - length(local), vec2(EDGE)) : 1.0 + EDGE - abs(local);
    vec3 share = clamp(depth / EDGE, 0.0, 1.0);
    share *= share * (3.0 - 2.0 * share);
    return is_far(room) || room.captured_at.w > 2.5 ? 0.0 : share.x * share.y * share.z;
}

float metres_away(Room room, vec3 local) {
    vec3 beyond = is_sphere(room) ? local * (1.0 - 1.0 / max(length(local), 1.0)) : max(abs(local) - 1.0, 0.0);
    beyond /= vec3(length(room.x.xyz), length(room.y.xyz), length(room.z.xyz));
    return is_far(room) || room.captured_at.w > 2.5 ? 1e30 : length(beyond);
}

// 1 where a number is the least, for the first of equals.
vec4 first_least(vec4 numbers) {
    float least = min(min(numbers.x, numbers.y), min(numbers.z, numbers.w));
    vec4 found = vec4(lessThanEqual(numbers, vec4(least)));
    return found * vec4(1.0, 1.0 - found.x, (1.0 - found.x) * (1.0 - found.y), (1.0 - found.x) * (1.0 - found.y) * (1.0 - found.z));
}

// How much of each room's diffuse light reaches a point, and 1 for the room that it mirrors.
void choose_rooms(vec3 point, out vec4 weights, out vec4 mirrored) {
    vec4 claims, metres, rank, far;
    for (int i = 0; i < MAX_ROOMS; ++i) {
        Room room = room_at(i);
        vec3 local = in_room(room, point);
        claims[i] = claim_of(room, local);
        metres[i] = metres_away(room, local);
        far[i] = is_far(room) ? 1.0 : 0.0;
        bool inside = within(room, local) && room.captured_at.w < 2.5;
        rank[i] = is_far(room) ? -1.0 : inside ? -2.0 : metres[i];
    }
    mirrored = first_least(rank);
    float total = dot(claims, vec4(1.0)), count = dot(far, vec4(1.0));
    vec4 shared = claims / max(total, 1.0) + far * max(1.0 - total, 0.0) / max(count, 1.0);
    weights = count > 0.5 ? shared : total > 0.0 ? claims / max(total, 1e-20) : first_least(metres);
}

vec4 row_of(int row, vec4 chosen) {
    return rooms[row] * chosen.x + rooms[row + ROWS] * chosen.y + rooms[row + 2 * ROWS] * chosen.z + rooms[row + 3 * ROWS] * chosen.w;
}

Room chosen_room(vec4 chosen) {
    return Room(row_of(0, chosen), row_of(1, chosen), row_of(2, chosen), row_of(3, chosen), row_of(4, chosen), row_of(5, chosen),
                row_of(6, chosen), row_of(7, chosen), row_of(8, chosen));
}

vec3 diffuse_among(vec4 weights, vec3 normal) {
    vec3 light = vec3(0.0);
    for (int i = 0; i < MAX_ROOMS; ++i) light += weights[i] * diffuse_in(room_at(i), normal);
    return light;
}
