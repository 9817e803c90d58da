/* See sums.h. The meshes and rays are made of integers, so that compilers cannot round them differently.
 *
 * SUMS_TINY leaves out the large mesh and all that takes more than 16 KB of RAM. */

#include "sums.h"

#include <hgrid.h>

#define COUNT(array) (sizeof(array) / sizeof *(array))

/* Two wavy sheets of squares, one above the other, and at the end a triangle across both, one without area,
 * one that is not finite. */
#ifdef SUMS_TINY
enum { SIDE = 3, RAYS = 16 };
#define INDEX_BYTES HGRID_INDEX_BOUND_ONE_LEVEL(TRIANGLES)
#define SCRATCH_BYTES HGRID_SCRATCH_BOUND_ONE_LEVEL(TRIANGLES)
#else
enum { SIDE = 16, RAYS = 256 };
#define INDEX_BYTES (1280 << 10)
#define SCRATCH_BYTES (512 << 10)
#define PACKED_BYTES (INDEX_BYTES + (64 << 10))
HGRID_ALIGNED static unsigned char packed[PACKED_BYTES];
static unsigned char sorting[16 * RAYS];
static uint8_t occluded[RAYS];
static hgrid_hit hits[RAYS];
#endif
enum {
    SHEET = (SIDE + 1) * (SIDE + 1),
    VERTICES = 2 * SHEET + 7,
    TRIANGLES = 4 * SIDE * SIDE + 3,
    ROOM = 4
};

HGRID_ALIGNED static unsigned char index_region[INDEX_BYTES];
HGRID_ALIGNED static unsigned char scratch[SCRATCH_BYTES];
static float positions[VERTICES][3];
static uint16_t indices[TRIANGLES][3];
static uint32_t masks[TRIANGLES];
static hgrid_ray rays[RAYS];

static uint32_t state;

/* Returns a random number below a limit. */
static uint32_t random_below(uint32_t limit)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % limit;
}

static float from_bits(uint32_t bits)
{
    union {
        uint32_t bits;
        float value;
    } both;
    both.bits = bits;
    return both.value;
}

static uint32_t bits_of(float value)
{
    union {
        uint32_t bits;
        float value;
    } both;
    both.value = value;
    return both.bits;
}

/* FNV-1a over integers, lowest byte first on every machine. */
static uint64_t sum;

static void add(uint64_t number)
{
    int byte;
    for (byte = 0; byte < 8; byte++)
        sum = (sum ^ (number >> 8 * byte & 0xff)) * 0x100000001b3u;
}

static void add_floats(const float *values, int count)
{
    for (int i = 0; i < count; i++)
        add(bits_of(values[i]));
}

static void add_hit(const hgrid_hit *hit)
{
    add_floats(&hit->t, 1), add_floats(&hit->u, 1), add_floats(&hit->v, 1);
    add(hit->primitive);
}

static void start(void)
{
    sum = 0xcbf29ce484222325u;
}

static void set_vertex(uint32_t vertex, uint32_t x, uint32_t y, uint32_t z)
{
    positions[vertex][0] = (float)x / 1024;
    positions[vertex][1] = (float)y / 1024;
    positions[vertex][2] = (float)z / 1024;
}

static void set_triangle(uint32_t triangle, uint32_t a, uint32_t b, uint32_t c)
{
    indices[triangle][0] = (uint16_t)a;
    indices[triangle][1] = (uint16_t)b;
    indices[triangle][2] = (uint16_t)c;
    masks[triangle] = 1u << triangle % 5;
}

/* Makes sheets 1024 units on a side; the seed decides their waves. */
static void make_mesh(uint32_t seed)
{
    uint32_t triangle = 0;
    state = seed;
    for (uint32_t sheet = 0; sheet < 2; sheet++) {
        const uint32_t first = sheet * SHEET;
        for (uint32_t y = 0; y <= SIDE; y++)
            for (uint32_t x = 0; x <= SIDE; x++)
                set_vertex(first + y * (SIDE + 1) + x, x * 1024 / SIDE, y * 1024 / SIDE,
                           300 * sheet + random_below(128));
        for (uint32_t y = 0; y < SIDE; y++)
            for (uint32_t x = 0; x < SIDE; x++) {
                const uint32_t a = first + y * (SIDE + 1) + x, d = a + SIDE + 1;
                set_triangle(triangle++, a, a + 1, d + 1);
                set_triangle(triangle++, a, d + 1, d);
            }
    }
    const uint32_t last = 2 * SHEET;
    set_vertex(last, 0, 100, 0), set_vertex(last + 1, 1024, 400, 100);
    set_vertex(last + 2, 500, 900, 428);
    set_triangle(triangle++, last, last + 1, last + 2);
    set_vertex(last + 3, 10, 10, 10), set_vertex(last + 4, 20, 20, 20);
    set_vertex(last + 5, 30, 30, 30);
    set_triangle(triangle++, last + 3, last + 4, last + 5);
    set_vertex(last + 6, 512, 512, 512);
    positions[last + 6][0] = from_bits(0x7fc00000u);
    set_triangle(triangle++, last, last + 1, last + 6);
}

/* Makes a camera's rays, then rays through a box around the mesh, some along axes and some invalid. */
static void make_rays(void)
{
    const float infinity = from_bits(0x7f800000u);
    state = 77;
    for (uint32_t i = 0; i < RAYS; i++) {
        hgrid_ray *ray = &rays[i];
        ray->t_min = 0, ray->t_max = infinity;
        if (i < RAYS / 2) {
            ray->origin[0] = 0.5f, ray->origin[1] = 0.25f, ray->origin[2] = 2;
            ray->direction[0] = ((float)(i % 16) - 7.5f) / 32;
            ray->direction[1] = ((float)(i / 16 * 256 / RAYS) - 7.5f) / 32;
            ray->direction[2] = -1;
            continue;
        }
        for (int axis = 0; axis < 3; axis++) {
            const float target = (float)random_below(1025) / 1024;
            ray->origin[axis] = (float)random_below(3000) / 1024 - 1;
            ray->direction[axis] = target - ray->origin[axis];
        }
        if (i % 8 == 0)
            ray->direction[i / 8 % 3] = 0;
        if (i % 16 == 1)
            ray->t_max = 0.75f, ray->t_min = 0.25f;
        if (i % 64 == 3)
            ray->direction[1] = from_bits(0x7fc00000u);
    }
}

static hgrid_verdict every_second(void *context, size_t ray, const hgrid_hit *hit)
{
    (void)context, (void)ray;
    return hit->primitive % 2 ? HGRID_ACCEPT : HGRID_REJECT;
}

/* Traces one ray after the other, and adds up the work. */
static void ask_alone(const hgrid_grid *grid, const char *mesh, const char *method)
{
    hgrid_counters work = {0, 0, 0};
    hgrid_query_options counting = HGRID_QUERY_OPTIONS_INIT, with = HGRID_QUERY_OPTIONS_INIT;
    hgrid_hit hit, all[ROOM];
    hgrid_surface at;
    hgrid_closest near;
    size_t count;
    start();
    for (int i = 0; i < RAYS; i++)
        if (hgrid_intersect(grid, &rays[i], NULL, &hit))
            add((uint64_t)i), add_hit(&hit);
    say(mesh, method, "closest", sum);

    start();
    for (int i = 0; i < RAYS; i++)
        add(hgrid_occluded(grid, &rays[i], NULL));
    say(mesh, method, "any", sum);

    start();
    for (int i = 0; i < RAYS; i++) {
        add((uint64_t)hgrid_intersect_all(grid, &rays[i], NULL, all, ROOM, &count));
        add(count);
        for (size_t j = 0; j < count && j < ROOM; j++)
            add_hit(&all[j]);
    }
    say(mesh, method, "all", sum);

    start();
    with.mask = 0x15;
    for (int i = 0; i < RAYS; i++) {
        with.cull = i % 2 ? HGRID_CULL_BACK : HGRID_CULL_FRONT;
        with.skip = (uint32_t)i;
        if (hgrid_intersect(grid, &rays[i], &with, &hit))
            add_hit(&hit);
        add(hgrid_occluded(grid, &rays[i], &with));
    }
    say(mesh, method, "culled", sum);

    start();
    with.mask = UINT32_MAX, with.cull = HGRID_CULL_NONE, with.skip = HGRID_INVALID_ID;
    with.filter = every_second;
    for (int i = 0; i < RAYS; i++)
        if (hgrid_intersect(grid, &rays[i], &with, &hit))
            add_hit(&hit);
    say(mesh, method, "filtered", sum);

    start();
    for (int i = 0; i < RAYS; i++)
        if (hgrid_intersect(grid, &rays[i], NULL, &hit) &&
            hgrid_surface_at(grid, &rays[i], &hit, &at)) {
            add_floats(at.position, 3), add_floats(at.normal, 3);
            add_floats(at.above, 3), add_floats(at.below, 3);
            add(at.is_front);
        }
    say(mesh, method, "surfaces", sum);

    start();
    for (int i = 0; i < RAYS; i += 3) {
        const float *from = rays[i].origin;
        const hgrid_point_query query = {{from[0], from[1], from[2]}, i % 2 ? 1.0f : rays[i].t_max};
        if (hgrid_closest_point(grid, &query, NULL, &near)) {
            add_floats(near.position, 3), add_floats(&near.distance, 1);
            add_floats(&near.u, 1), add_floats(&near.v, 1), add(near.primitive);
        }
    }
    say(mesh, method, "points", sum);

    start();
    counting.counters = &work;
    for (int i = 0; i < RAYS; i++)
        hgrid_intersect(grid, &rays[i], &counting, &hit);
    add(work.primitive_tests), add(work.cell_steps), add(work.grid_steps);
    say(mesh, method, "work", sum);
}

#ifndef SUMS_TINY
static int ask_together(const hgrid_grid *grid, const char *mesh, const char *method)
{
    hgrid_query_options with = HGRID_QUERY_OPTIONS_INIT;
    for (int round = 0; round < 4; round++) {
        static const char *const names[] = {"batch", "sorted", "batch-culled", "batch-any"};
        const hgrid_coherence how =
            round == 1 ? HGRID_COHERENCE_INCOHERENT : HGRID_COHERENCE_COHERENT;
        hgrid_status status;
        with.scratch = round == 1 ? sorting : NULL;
        with.scratch_bytes = round == 1 ? sizeof sorting : 0;
        with.mask = round == 2 ? 0x15 : UINT32_MAX;
        with.cull = round == 2 ? HGRID_CULL_BACK : HGRID_CULL_NONE;
        if (round < 3)
            status = hgrid_intersect_n(grid, rays, 0, hits, 0, RAYS, how, &with);
        else
            status = hgrid_occluded_n(grid, rays, 0, occluded, 0, RAYS, how, &with);
        if (status != HGRID_OK)
            return 10 + round;
        start();
        for (int i = 0; i < RAYS; i++)
            if (round == 3)
                add(occluded[i]);
            else if (hits[i].primitive != HGRID_INVALID_ID)
                add((uint64_t)i), add_hit(&hits[i]);
        say(mesh, method, names[round], sum);
    }
    return 0;
}
#endif

static int add_content(const hgrid_grid *grid)
{
    hgrid_statistics found = HGRID_STATISTICS_INIT;
    const hgrid_status status = hgrid_inspect(grid, &found);
    add(found.content_hash), add(found.list_count), add(found.reference_count);
    add(found.longest_list), add(found.skipped_count), add(found.degenerate_count);
    return status != HGRID_OK;
}

static int ask(const hgrid_config *config, const char *mesh_name, const char *name)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    hgrid_hit hit;
    make_mesh(5);
    mesh.positions = positions, mesh.vertex_count = VERTICES;
    mesh.indices = indices, mesh.triangle_count = TRIANGLES, mesh.index_type = HGRID_INDEX_U16;
    mesh.masks = masks;

    start();
    if (hgrid_bound(TRIANGLES, config, &report) != HGRID_OK)
        return 1;
    add(report.index_bytes), add(report.scratch_bytes);
    if (hgrid_sizes(&mesh, config, scratch, sizeof scratch, &report) != HGRID_OK)
        return 2;
    add(report.index_bytes), add(report.scratch_bytes), add(report.is_exact);
    if (hgrid_build(&mesh, config, index_region, sizeof index_region, scratch, sizeof scratch,
                    &grid, &report) != HGRID_OK)
        return 3;
    add(report.index_bytes);
    if (add_content(&grid))
        return 4;
    say(mesh_name, name, "build", sum);

    ask_alone(&grid, mesh_name, name);
#ifndef SUMS_TINY
    const int failure = ask_together(&grid, mesh_name, name);
    if (failure)
        return failure;
    /* Ask again from a packed blob, which contains its mesh. */
    hgrid_grid opened;
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    uint64_t bytes;
    if (hgrid_pack(&grid, packed, sizeof packed, &bytes) != HGRID_OK)
        return 20;
    if (hgrid_peek(packed, 128, &info) != HGRID_OK ||
        hgrid_open(packed, (size_t)bytes, NULL, &opened) != HGRID_OK)
        return 21;
    start();
    add(bytes), add(info.grid_bytes), add(info.method), add(info.triangle_count);
    if (add_content(&opened))
        return 22;
    for (int i = 0; i < RAYS; i++)
        if (hgrid_intersect(&opened, &rays[i], NULL, &hit))
            add_hit(&hit);
    say(mesh_name, name, "packed", sum);
#endif

    /* Damage a word at a time, and validate the grid each time. All four bytes change alike: a word may hold bytes, in
     * which the byte order of the machine does not matter. */
    if (hgrid_validate(&grid, scratch, sizeof scratch) != HGRID_OK)
        return 30;
    start();
    for (size_t at = 0; at + 4 <= (size_t)report.index_bytes; at += (size_t)report.index_bytes / 17) {
        uint32_t *word = (uint32_t *)(void *)(index_region + at / 4 * 4);
        *word ^= 0x01010101;
        add((uint64_t)hgrid_validate(&grid, scratch, sizeof scratch));
        *word ^= 0x01010101;
    }
    say(mesh_name, name, "proofs", sum);

    if (config->method == HGRID_METHOD_BVH) {
        hgrid_refit_report told = HGRID_REFIT_REPORT_INIT;
        make_mesh(6);
        if (hgrid_refit(&mesh, index_region, (size_t)report.index_bytes, &grid, &told) != HGRID_OK)
            return 40;
        start();
        if (add_content(&grid))
            return 41;
        for (int i = 0; i < RAYS; i++)
            if (hgrid_intersect(&grid, &rays[i], NULL, &hit))
                add_hit(&hit);
        say(mesh_name, name, "refit", sum);
    }
    return 0;
}

#ifndef SUMS_TINY
#include "crowd_sums.h"
#include "scene_sums.h"
#endif

int sums(void)
{
    static const hgrid_config configs[] = {HGRID_CONFIG_INIT_BVH, HGRID_CONFIG_INIT_BVH,
                                           HGRID_CONFIG_INIT_ONE_LEVEL, HGRID_CONFIG_INIT_FIXED,
                                           HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE};
    static const char *const names[] = {"bvh",   "bvh-high", "one-level",
                                        "fixed", "variable", "recursive"};
#ifdef SUMS_TINY
    static const char mesh[] = "tiny";
#else
    static const char mesh[] = "large";
#endif
    make_rays();
    for (size_t i = 0; i < COUNT(configs); i++) {
        hgrid_config config = configs[i];
        if (!hgrid_has_method(config.method))
            continue;
#ifdef SUMS_TINY
        /* The other methods need too much stack or index here. */
        if (config.method != HGRID_METHOD_ONE_LEVEL)
            continue;
#endif
        if (i == 1)
            config.quality = HGRID_QUALITY_HIGH;
        if (config.method == HGRID_METHOD_RECURSIVE)
            config.depth = 1; /* With depth 3 this mesh takes nine megabytes. */
        const int failure = ask(&config, mesh, names[i]);
        if (failure)
            return 100 * (int)i + failure;
    }
#ifndef SUMS_TINY
    if (hgrid_has_method(HGRID_METHOD_BVH)) {
        const int of_crowd = ask_crowd();
        if (of_crowd)
            return 900 + of_crowd;
        const int failure = ask_scenes();
        if (failure)
            return 1000 + failure;
    }
#endif
    return 0;
}
