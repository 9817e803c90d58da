/* Mistakes that a query can only answer with a miss. Without an argument the program prints their names. With a
 * name it makes this mistake, and succeeds if the answer is a miss: a debug build of the library stops it before. With
 * "legal" it asks for misses that no build stops at. */

#include "scenes.h"

#include <sys/resource.h>

static hgrid_ray ray;
static hgrid_ray_f64 ray_in_scene;
static hgrid_query_options options;
static hgrid_scene_options options_in_scene;
static const hgrid_query_options default_options = HGRID_QUERY_OPTIONS_INIT;
static const hgrid_scene_options default_options_in_scene = HGRID_SCENE_OPTIONS_INIT;

/* One query a function: true if it finds nothing. */

static bool intersect_misses(void)
{
    hgrid_hit hit;
    return !hgrid_intersect(&grid, &ray, &options, &hit);
}

static bool occluded_misses(void)
{
    return !hgrid_occluded(&grid, &ray, &options);
}

static bool occluder_misses(void)
{
    return hgrid_occluder(&grid, &ray, &options) == HGRID_INVALID_ID;
}

static bool intersect_all_misses(void)
{
    size_t count = 1;
    return hgrid_intersect_all(&grid, &ray, &options, NULL, 0, &count) == HGRID_OK && count == 0;
}

static bool closest_point_misses(void)
{
    const hgrid_point_query query = {{0.5f, 0.5f, 1}, 5};
    hgrid_closest closest;
    return !hgrid_closest_point(&grid, &query, &options, &closest);
}

static bool intersect_shapes_misses(void)
{
    hgrid_hit hit;
    return !hgrid_intersect_shapes(&shapes, &ray, &options, &hit);
}

static bool occluded_shapes_misses(void)
{
    return !hgrid_occluded_shapes(&shapes, &ray, &options);
}

static bool intersect_scene_misses(void)
{
    hgrid_scene_hit hit;
    return !hgrid_intersect_scene(&scene, &ray_in_scene, &options_in_scene, &hit);
}

static bool occluded_scene_misses(void)
{
    return !hgrid_occluded_scene(&scene, &ray_in_scene, &options_in_scene);
}

static bool surface_at_misses(void)
{
    const hgrid_hit hit = {1, 0, 0, 0};
    hgrid_surface surface;
    return !hgrid_surface_at(&grid, &ray, &hit, &surface);
}

static bool scene_surface_at_misses(void)
{
    const hgrid_scene_hit hit = {1, 0, 0, 0, {0, 0, HGRID_INVALID_ID, HGRID_INVALID_ID}};
    hgrid_scene_surface surface;
    return !hgrid_scene_surface_at(&scene, &ray_in_scene, &hit, &surface);
}

static const struct {
    const char *function;
    bool (*misses)(void);
    /* Has options, and no status that tells what is wrong with them. */
    bool has_options;
    bool has_ray;
} queries[] = {
    {"hgrid_intersect", intersect_misses, true, true},
    {"hgrid_occluded", occluded_misses, true, true},
    {"hgrid_occluder", occluder_misses, true, true},
    {"hgrid_intersect_all", intersect_all_misses, false, true},
    {"hgrid_closest_point", closest_point_misses, true, false},
    {"hgrid_intersect_shapes", intersect_shapes_misses, true, true},
    {"hgrid_occluded_shapes", occluded_shapes_misses, true, true},
    {"hgrid_intersect_scene", intersect_scene_misses, true, true},
    {"hgrid_occluded_scene", occluded_scene_misses, true, true},
    {"hgrid_surface_at", surface_at_misses, false, true},
    {"hgrid_scene_surface_at", scene_surface_at_misses, false, true},
};

enum { QUERIES = sizeof queries / sizeof *queries };

/* Sets rays and options that no build stops at. The rays hit mesh, shapes and scene. */
static void set_all(void)
{
    const float x = spheres[0].center[0], y = spheres[0].center[1];
    ray = ray_down(x, y);
    ray.origin[2] = 2;
    ray_in_scene = wide_ray((double)x, (double)y, 2);
    options = default_options;
    options_in_scene = default_options_in_scene;
}

/* Each mistake sets what it is wrong in. */

static void zero_options(void)
{
    memset(&options, 0, sizeof options);
    memset(&options_in_scene, 0, sizeof options_in_scene);
}

static void set_wrong_struct(void)
{
    options.reserved = 1;
    /* Those of a scene have no reserved field. */
    options_in_scene.struct_size--;
}

static void set_unknown_cull(void)
{
    options.cull = options_in_scene.cull = 3;
}

static void zero_rays(void)
{
    memset(&ray, 0, sizeof ray);
    memset(&ray_in_scene, 0, sizeof ray_in_scene);
}

static const struct {
    const char *name;
    void (*make)(void);
    bool is_of_ray;
} mistakes[] = {
    {"options", zero_options, false},
    {"struct", set_wrong_struct, false},
    {"cull", set_unknown_cull, false},
    {"ray", zero_rays, true},
};

enum { MISTAKES = sizeof mistakes / sizeof *mistakes };

/* Makes the mistake of this name, or prints the names of all. */
static bool make_mistake(const char *wanted)
{
    char name[256];
    for (int m = 0; m < MISTAKES; m++)
        for (int q = 0; q < QUERIES; q++) {
            if (mistakes[m].is_of_ray ? !queries[q].has_ray : !queries[q].has_options)
                continue;
            snprintf(name, sizeof name, "%s %s", mistakes[m].name, queries[q].function);
            if (wanted == NULL) {
                puts(name);
            } else if (strcmp(name, wanted) == 0) {
                set_all();
                mistakes[m].make();
                return queries[q].misses();
            }
        }
    return wanted == NULL;
}

/* Every build answers these. */
static void ask_what_is_legal(void)
{
    const hgrid_grid no_grid = HGRID_GRID_INIT;
    const hgrid_point_query at_origin = {{0, 0, 0}, 0};
    hgrid_closest closest;
    hgrid_hit hit;
    uint8_t is_occluded = 1;
    size_t count = 1;
    set_all();
    for (int q = 0; q < QUERIES; q++)
        CHECK(!queries[q].misses());
    /* No direction, in a ray that was written. */
    memset(ray.direction, 0, sizeof ray.direction);
    memset(ray_in_scene.direction, 0, sizeof ray_in_scene.direction);
    for (int q = 0; q < QUERIES; q++)
        CHECK(!queries[q].has_ray || queries[q].misses());
    /* Options that see nothing. */
    set_all();
    options.mask = options_in_scene.mask = 0;
    for (int q = 0; q < QUERIES; q++)
        CHECK(!queries[q].has_options || queries[q].misses());
    /* A query of zeros is one for the point at the origin, where the sheet has a vertex. */
    CHECK(hgrid_closest_point(&grid, &at_origin, NULL, &closest));
    /* NULL, and a view of zeros. */
    CHECK(!hgrid_intersect(&grid, NULL, NULL, &hit));
    CHECK(!hgrid_intersect(&no_grid, &ray, NULL, &hit));
    /* A status tells what is wrong. */
    zero_options();
    CHECK(hgrid_intersect_all(&grid, &ray, &options, NULL, 0, &count) == HGRID_ERROR_STRUCT_SIZE);
    CHECK(hgrid_occluded_n(&grid, &ray, 0, &is_occluded, 0, 1, HGRID_COHERENCE_COHERENT, &options) ==
          HGRID_ERROR_STRUCT_SIZE);
    /* Rays of zeros in a batch. */
    zero_rays();
    CHECK(hgrid_occluded_n(&grid, &ray, 0, &is_occluded, 0, 1, HGRID_COHERENCE_COHERENT, NULL) == HGRID_OK);
    CHECK(is_occluded == 0);
}

int main(int count, char **arguments)
{
    const struct rlimit none = {0, 0};
    /* A stop leaves no core file behind. */
    CHECK(setrlimit(RLIMIT_CORE, &none) == 0);
    if (count < 2)
        return make_mistake(NULL) ? 0 : 1;
    prepare();
    build_shapes();
    build_inner(INDEX_BYTES, SCRATCH_BYTES);
    build_outer();
    if (strcmp(arguments[1], "legal") == 0)
        ask_what_is_legal();
    else
        CHECK(make_mistake(arguments[1]));
    return 0;
}
