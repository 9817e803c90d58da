/* Prints the stack use of queries and builds in bytes, one "name most" a line: the most over all methods and meshes
 * (stack.h), on a stack that was filled before. A line "name_few most" tells the same of trees of few levels, for
 * calls that walk one tree, and "levels most" the levels of the deepest tree. Grids also stand in scenes, and their
 * triangles serve as shapes.
 *
 * A ray that meets many boxes at once takes more stack than others. In a tangle it does: long triangles overlap, and
 * a chain of ever smaller ones makes a deep tree. The instances of a scene have such a chain, too. */

#include "check.h"
#include "stack.h"

#include <ucontext.h>

enum { TILED = 768, RAYS = TILED + 256, STACK = 256 * 1024 };

/* Rays take less stack in trees of no more levels; and the place of their number in a blob (docs/format.md). */
enum { FEW_LEVELS = 14, LEVELS_AT = 116 };

static hgrid_mesh mesh;
/* The mesh is a tangle, a chain or nested: some of them take rays long. */
static bool is_slow;

/* A build with memory for it. */
typedef struct {
    hgrid_config config;
    hgrid_report need;
    void *index, *scratch;
} job;

static job by_one_task, by_many_tasks;

static hgrid_grid grid;
static hgrid_ray rays[RAYS], mixed[RAYS];
static hgrid_hit hits[RAYS];
static uint8_t occluded[RAYS];
static uint32_t occluders[RAYS];
static hgrid_counters counters;

static void one(void)
{
    for (int i = 0; i < RAYS; i++) {
        hgrid_intersect(&grid, &rays[i], NULL, &hits[i]);
        hgrid_occluded(&grid, &rays[i], NULL);
    }
}

static hgrid_verdict reject(void *context, size_t ray, const hgrid_hit *hit)
{
    return context == &grid && ray < RAYS && hit->t >= 0 ? HGRID_REJECT : HGRID_ACCEPT;
}

static hgrid_query_options options(void)
{
    hgrid_query_options all = HGRID_QUERY_OPTIONS_INIT;
    all.mask = 1, all.skip = 3;
    all.filter = reject, all.context = &grid, all.counters = &counters;
    return all;
}

static void with_options(void)
{
    const hgrid_query_options all = options();
    size_t count;
    for (int i = 0; i < RAYS; i++) {
        hgrid_intersect(&grid, &rays[i], &all, &hits[i]);
        hgrid_occluded(&grid, &rays[i], &all);
        CHECK(hgrid_intersect_all(&grid, &rays[i], &all, hits, RAYS, &count) == HGRID_OK);
        CHECK(hgrid_intersect_all(&grid, &rays[i], NULL, hits, RAYS, &count) == HGRID_OK);
    }
}

static void closest(void)
{
    for (int i = 0; i < RAYS; i += 20) {
        const hgrid_query_options all = options();
        const hgrid_point_query query = anywhere(rays[i].origin);
        hgrid_closest found;
        hgrid_closest_point(&grid, &query, NULL, &found);
        hgrid_closest_point(&grid, &query, &all, &found);
    }
}

static void many(void)
{
    const hgrid_query_options all = options();
    hgrid_query_options masked = HGRID_QUERY_OPTIONS_INIT;
    masked.mask = 1;
    const int first = is_slow ? RAYS - 64 : 0;
    const size_t count = (size_t)(RAYS - first);
    const hgrid_ray *const far = mixed + first, *const near = rays + first;
    for (hgrid_coherence c = 0; c < 2; c++) {
        /* Rays far from each other, some of them to be sorted, some to be traced alone. */
        CHECK(hgrid_intersect_n(&grid, far, 0, hits, 0, count, c, NULL) == HGRID_OK);
        CHECK(hgrid_intersect_n(&grid, far, 0, hits, 0, count, c, &masked) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, far, 0, occluded, 0, count, c, &masked) == HGRID_OK);
        CHECK(hgrid_intersect_n(&grid, near, 0, hits, 0, count, c, NULL) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, near, 0, occluded, 0, count, c, NULL) == HGRID_OK);
        CHECK(hgrid_intersect_n(&grid, near, 0, hits, 0, count, c, &all) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, near, 0, occluded, 0, count, c, &all) == HGRID_OK);
        CHECK(hgrid_occluder_n(&grid, far, 0, occluders, 0, count, c, NULL) == HGRID_OK);
        /* A filter that rejects, after a group of rays was traced, for each order of the rays. */
        const hgrid_ray *each[] = {far, near};
        for (int i = 0; i < 4; i++) {
            hgrid_query_options asking = HGRID_QUERY_OPTIONS_INIT;
            asking.filter = reject, asking.context = &grid;
            asking.filter_mask = i < 2 ? 0 : 1;
            const hgrid_ray *from = each[i % 2];
            CHECK(hgrid_intersect_n(&grid, from, 0, hits, 0, count, c, &asking) == HGRID_OK);
            CHECK(hgrid_occluded_n(&grid, from, 0, occluded, 0, count, c, &asking) == HGRID_OK);
            CHECK(hgrid_occluder_n(&grid, from, 0, occluders, 0, count, c, &asking) == HGRID_OK);
        }
    }
}

enum { SHOWN = 12, SHOWN_FEW = 2, LINKS = 240, SHAPES = (int)TRIANGLES + (int)TANGLE };

/* Nested scenes around a tree, each of which shows the one before, as deep as allowed. */
static hgrid_object shown[HGRID_MAX_NESTING][2];
static hgrid_scene around[HGRID_MAX_NESTING];
static hgrid_shapes corners;
/* A scene that shows all kinds of objects, nested as deep as allowed. */
static hgrid_scene all_kinds;
HGRID_ALIGNED static unsigned char scene_blobs[HGRID_MAX_NESTING][HGRID_SCENE_BOUND(SHOWN + LINKS)];
HGRID_ALIGNED static unsigned char all_kinds_blob[HGRID_SCENE_BOUND(SHOWN)];
HGRID_ALIGNED static unsigned char small_scratch[HGRID_BVH_HIGH_SCRATCH_BOUND(SHAPES)];
HGRID_ALIGNED static unsigned char shape_blob[HGRID_INDEX_BOUND(SHAPES)];
static void *const shapes_index = shape_blob;
HGRID_ALIGNED static unsigned char link_blob[HGRID_INDEX_BOUND(TRIANGLES)];
static float corner_boxes[SHAPES][6];
/* The mesh of the instances in chains, and its tree. */
static sheet link_mesh;
static hgrid_grid link_tree;

static hgrid_verdict reject_in_scene(void *context, size_t ray, const hgrid_scene_hit *hit)
{
    (void)ray;
    return context == &grid && hit->t >= 0 ? HGRID_REJECT : HGRID_ACCEPT;
}

static void ask_scene(const hgrid_scene *scene)
{
    hgrid_scene_options all = HGRID_SCENE_OPTIONS_INIT;
    all.filter = reject_in_scene, all.context = &grid, all.counters = &counters;
    for (int i = 0; i < RAYS; i += 24) {
        hgrid_ray_f64 ray = {{0, 0, 0}, {0, 0, 0}, 0, INFINITY, 0};
        for (int axis = 0; axis < 3; axis++)
            ray.origin[axis] = (double)rays[i].origin[axis], ray.direction[axis] = rays[i].direction[axis];
        hgrid_scene_hit hit;
        hgrid_intersect_scene(scene, &ray, NULL, &hit);
        hgrid_occluded_scene(scene, &ray, NULL);
        hgrid_intersect_scene(scene, &ray, &all, &hit);
        hgrid_occluded_scene(scene, &ray, &all);
    }
}

/* Traces batches: tiles, and rays to be sorted. */
static void ask_scene_together(const hgrid_scene *scene)
{
    static hgrid_ray_f64 wide[RAYS];
    static hgrid_scene_hit found[RAYS];
    static unsigned char sorted[16 * RAYS];
    const hgrid_ray *each[] = {mixed, rays};
    const int first = is_slow ? RAYS - 64 : 0;
    const size_t count = (size_t)(RAYS - first);
    for (int order = 0; order < 2; order++) {
        for (int i = 0; i < RAYS - first; i++) {
            const hgrid_ray *from = &each[order][first + i];
            hgrid_ray_f64 ray = {{0, 0, 0}, {0, 0, 0}, from->t_min, from->t_max, 0};
            /* Origins that float cannot represent are rounded in the scene's tree. */
            for (int axis = 0; axis < 3; axis++)
                ray.origin[axis] = (double)from->origin[axis] + 1e-12, ray.direction[axis] = from->direction[axis];
            wide[i] = ray;
        }
        hgrid_scene_options all = HGRID_SCENE_OPTIONS_INIT, masked = HGRID_SCENE_OPTIONS_INIT;
        all.filter = reject_in_scene, all.context = &grid, all.counters = &counters;
        masked.mask = 1, masked.cull = HGRID_CULL_BACK, masked.scratch = sorted, masked.scratch_bytes = sizeof sorted;
        for (hgrid_coherence c = 0; c < 2; c++) {
            CHECK(hgrid_intersect_scene_n(scene, wide, 0, found, 0, count, c, NULL) == HGRID_OK);
            CHECK(hgrid_occluded_scene_n(scene, wide, 0, occluded, 0, count, c, NULL) == HGRID_OK);
            CHECK(hgrid_intersect_scene_n(scene, wide, 0, found, 0, count, c, &masked) == HGRID_OK);
            CHECK(hgrid_occluded_scene_n(scene, wide, 0, occluded, 0, count, c, &masked) == HGRID_OK);
            CHECK(hgrid_intersect_scene_n(scene, wide, 0, found, 0, 64, c, &all) == HGRID_OK);
            CHECK(hgrid_occluded_scene_n(scene, wide, 0, occluded, 0, 64, c, &all) == HGRID_OK);
        }
    }
}

static void flat_scene(void)
{
    ask_scene(&around[0]);
}

static void flat_scene_together(void)
{
    ask_scene_together(&around[0]);
}

static void nested_scenes_together(void)
{
    ask_scene_together(&all_kinds);
}

static void nested_scenes(void)
{
    ask_scene(&around[HGRID_MAX_NESTING - 1]);
}

static bool meet_middle(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    (void)context, (void)shape;
    hit->t = ray->t_max < 1 ? ray->t_max : 1, hit->u = 0, hit->v = 0;
    return shape % 2 == 0;
}

static void boxes_of_triangles(void)
{
    hgrid_hit hit;
    const hgrid_query_options all = options();
    for (int i = 0; i < RAYS; i++) {
        hgrid_intersect_shapes(&corners, &rays[i], NULL, &hit);
        hgrid_occluded_shapes(&corners, &rays[i], NULL);
        hgrid_intersect_shapes(&corners, &rays[i], &all, &hit);
    }
}

static void boxes_of_triangles_together(void)
{
    static unsigned char sorted[16 * RAYS];
    hgrid_query_options masked = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_query_options all = options();
    const hgrid_ray *each[] = {mixed, rays};
    const int first = is_slow ? RAYS - 64 : 0;
    const size_t count = (size_t)(RAYS - first);
    masked.mask = 1, masked.scratch = sorted, masked.scratch_bytes = sizeof sorted;
    for (int order = 0; order < 2; order++)
        for (hgrid_coherence c = 0; c < 2; c++) {
            CHECK(hgrid_intersect_shapes_n(&corners, each[order] + first, 0, hits, 0, count, c, NULL) == HGRID_OK);
            CHECK(hgrid_occluded_shapes_n(&corners, each[order] + first, 0, occluded, 0, count, c, NULL) == HGRID_OK);
            CHECK(hgrid_intersect_shapes_n(&corners, each[order] + first, 0, hits, 0, count, c, &masked) == HGRID_OK);
            CHECK(hgrid_occluded_shapes_n(&corners, each[order] + first, 0, occluded, 0, count, c, &all) == HGRID_OK);
        }
}

/* Returns the quality of the grid, if it is a tree. */
static hgrid_config tree_config(void)
{
    hgrid_config config = HGRID_CONFIG_INIT;
    config.quality = by_one_task.config.quality;
    return config;
}

/* Builds a scene of instances of the first object, which overlap, and of a chain of instances of the second: their
 * boxes share a corner, where a ray along the diagonal enters all of them before it enters those of the first. */
static void build_level(int level, int count)
{
    static hgrid_instance instances[SHOWN + LINKS];
    const hgrid_config config = tree_config();
    for (int i = 0; i < count; i++) {
        const hgrid_instance fresh = HGRID_INSTANCE_INIT;
        instances[i] = fresh, instances[i].translation[i % 3] = 0.01 * i;
        for (int axis = 0; axis < 3; axis++)
            instances[i].translation[axis] += 0.02;
    }
    for (int i = 0; i < LINKS; i++) {
        const hgrid_instance fresh = HGRID_INSTANCE_INIT;
        hgrid_instance *const link = &instances[count + i];
        *link = fresh, link->object = 1;
        for (int axis = 0; axis < 3; axis++)
            link->linear[axis][axis] = ldexpf(1, -i / 2);
    }
    CHECK(hgrid_build_scene(instances, (size_t)count + LINKS, shown[level], 2, &config, scene_blobs[level],
                            sizeof scene_blobs[level], small_scratch, sizeof small_scratch, &around[level],
                            NULL) == HGRID_OK);
}

/* Builds shapes as large as the first triangles of the mesh. */
static void build_shapes(void)
{
    const hgrid_config config = tree_config();
    const size_t most = SHAPES, count = mesh.triangle_count < most ? mesh.triangle_count : most;
    for (size_t i = 0; i < count; i++)
        for (int axis = 0; axis < 3; axis++) {
            float *const low = &corner_boxes[i][axis], *const high = low + 3;
            *low = *high = positions[indices[i][0]][axis];
            for (int corner = 1; corner < 3; corner++) {
                const float at = positions[indices[i][corner]][axis];
                *low = at < *low ? at : *low, *high = at > *high ? at : *high;
            }
        }
    hgrid_boxes boxes = HGRID_BOXES_INIT;
    boxes.boxes = corner_boxes, boxes.count = count, boxes.test = meet_middle;
    CHECK(hgrid_build_shapes(&boxes, &config, shape_blob, sizeof shape_blob, small_scratch, sizeof small_scratch,
                             &corners, NULL) == HGRID_OK);
}

/* Builds nested scenes, shapes, and a scene of both. */
static void build_scenes(void)
{
    make_sheet(&link_mesh);
    const hgrid_mesh link = mesh_of(&link_mesh);
    CHECK(hgrid_build(&link, NULL, link_blob, sizeof link_blob, small_scratch, sizeof small_scratch, &link_tree,
                      NULL) == HGRID_OK);
    for (int level = 0; level < HGRID_MAX_NESTING; level++) {
        hgrid_object *const inner = &shown[level][0];
        const hgrid_status status = level == 0 ? hgrid_object_grid(&grid, inner)
                                               : hgrid_object_scene(&around[level - 1], inner);
        CHECK(status == HGRID_OK);
        CHECK(hgrid_object_grid(&link_tree, &shown[level][1]) == HGRID_OK);
        build_level(level, level == 0 && !is_slow ? SHOWN : SHOWN_FEW);
    }
    build_shapes();
    static hgrid_object kinds[3];
    hgrid_instance instances[3];
    for (uint32_t i = 0; i < 3; i++) {
        const hgrid_instance fresh = HGRID_INSTANCE_INIT;
        instances[i] = fresh, instances[i].object = i;
    }
    CHECK(hgrid_object_grid(&grid, &kinds[0]) == HGRID_OK && hgrid_object_shapes(&corners, &kinds[1]) == HGRID_OK);
    CHECK(hgrid_object_scene(&around[HGRID_MAX_NESTING - 2], &kinds[2]) == HGRID_OK);
    CHECK(hgrid_build_scene(instances, 3, kinds, 3, NULL, all_kinds_blob, sizeof all_kinds_blob, small_scratch,
                            sizeof small_scratch, &all_kinds, NULL) == HGRID_OK);
}

/* Returns the bytes of stack that a call takes. A call that itself measures uses the second stack. */
static size_t stack_of(void (*call)(void))
{
    static unsigned char stacks[2][STACK];
    static ucontext_t here[2], there[2];
    static size_t depth = 0;
    unsigned char *const stack = stacks[depth];
    ucontext_t *const from = &here[depth], *const to = &there[depth];
    memset(stack, 0xc7, STACK);
    CHECK(getcontext(to) == 0);
    to->uc_stack.ss_sp = stack;
    to->uc_stack.ss_size = STACK;
    to->uc_link = from;
    makecontext(to, call, 0);
    depth++;
    CHECK(swapcontext(from, to) == 0);
    depth--;
    size_t unused = 0;
    while (unused < STACK && stack[unused] == 0xc7)
        unused++;
    return STACK - unused;
}

static size_t most_of_a_task;
static struct {
    hgrid_task call;
    void *context;
    uint32_t index;
} next_task;

static void one_task(void)
{
    next_task.call(next_task.context, next_task.index);
}

/* Runs every task on a stack of its own, as a thread has. */
static void run(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    (void)context;
    for (uint32_t i = 0; i < count; i++) {
        next_task.call = task, next_task.context = task_context, next_task.index = i;
        const size_t bytes = stack_of(one_task);
        most_of_a_task = bytes > most_of_a_task ? bytes : most_of_a_task;
    }
}

static job job_of(int method, uint32_t tasks)
{
    const hgrid_report fresh = HGRID_REPORT_INIT;
    job made;
    /* After the usual methods comes a tree of high quality. */
    made.config = usual(method < METHODS ? method : METHODS - 1), made.need = fresh;
    if (method == METHODS)
        made.config.quality = HGRID_QUALITY_HIGH;
    made.config.tasks = tasks, made.config.run = run;
    CHECK(hgrid_sizes(&mesh, &made.config, NULL, 0, &made.need) == HGRID_OK);
    made.index = guarded((size_t)made.need.index_bytes);
    made.scratch = guarded((size_t)made.need.scratch_bytes);
    return made;
}

/* Calls every function that reads the mesh. */
static void work(const job *all)
{
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_config fitted = HGRID_CONFIG_INIT;
    hgrid_statistics statistics = HGRID_STATISTICS_INIT;
    const size_t index_bytes = (size_t)all->need.index_bytes;
    const size_t scratch_bytes = (size_t)all->need.scratch_bytes;
    CHECK(hgrid_sizes(&mesh, &all->config, NULL, 0, &report) == HGRID_OK);
    CHECK(hgrid_sizes(&mesh, &all->config, all->scratch, scratch_bytes, &report) == HGRID_OK);
    CHECK(hgrid_fit(&mesh, &all->config, index_bytes, all->scratch, scratch_bytes, &fitted, &report) == HGRID_OK);
    CHECK(hgrid_build(&mesh, &all->config, all->index, index_bytes, all->scratch, scratch_bytes,
                      &grid, &report) == HGRID_OK);
    /* Static memory, because heap functions take stack too. */
    static unsigned char bits[HGRID_VALIDATE_BOUND(TRIANGLES + CROWDS * CROWD)];
    CHECK(hgrid_validate_bytes(&grid) <= sizeof bits);
    CHECK(hgrid_validate(&grid, bits, sizeof bits) == HGRID_OK);
    CHECK(hgrid_inspect(&grid, &statistics) == HGRID_OK);
    if (all->config.method == HGRID_METHOD_BVH)
        CHECK(hgrid_refit(&mesh, all->index, index_bytes, &grid, NULL) == HGRID_OK);
}

static void build(void)
{
    work(&by_one_task);
}

static void tasks(void)
{
    work(&by_many_tasks);
}

/* Returns the levels of a tree, and 0 for another method. */
static uint32_t levels_of(const void *blob)
{
    uint32_t levels;
    memcpy(&levels, (const unsigned char *)blob + LEVELS_AT, sizeof levels);
    return levels;
}

/* Returns true if a mesh and a method are among those of a part: all methods over the sheet alone, trees over all
 * crowds and the nested mesh, and trees of high quality over the tangle and the chain. */
static bool is_of_part(uint32_t number, int method)
{
    const bool is_high = number == TANGLED || number == LINKED, is_fast = number == CROWDS || number == NESTED;
    return number == 0 || (is_high && method == METHODS) || (is_fast && method == METHODS - 1);
}

static void make_rays(void)
{
    for (int i = 0; i < TILED; i++) {
        /* Tiles of the sheet, some of them with rays in other directions, then tiles of the crowds. */
        const int tile = i / 64, pixel = i % 64, crowd = i / 128 - TILED / 128 + CROWDS;
        const float u = (float)(pixel % 8), v = (float)(pixel / 8);
        rays[i] = ray_down((float)(tile % 4) / 4 + u / 32, (float)(tile / 4) / 4 + v / 32);
        rays[i].direction[0] = tile > 4 && i % 7 == 0 ? -3.0f : 0.1f;
        if (crowd >= 0) {
            /* Two tiles whose rays interleave. */
            rays[i] = ray_down(CENTER[0] + WIDTH[crowd] * (u / 4 - 1 + (float)(tile % 2) / 8),
                               CENTER[1] + WIDTH[crowd] * (v / 4 - 1));
            /* Start among the triangles of the crowd; from above, all rays would end in the larger crowd
             * around it. */
            rays[i].origin[2] = CENTER[2] + 1.2f * WIDTH[crowd];
            rays[i].direction[0] = i % 7 == 0 ? -3.0f : 0.0f;
        }
    }
    for (int i = TILED; i < RAYS; i++) {
        /* Start at the end of the chains, along the diagonal or in any direction, and anywhere in the tangle. */
        const bool is_diagonal = i % 16 == 0;
        for (int axis = 0; axis < 3; axis++) {
            rays[i].origin[axis] = i % 2 == 0 ? 0 : random_number();
            rays[i].direction[axis] = is_diagonal ? 1 : random_number();
        }
        rays[i].t_min = 0, rays[i].t_max = INFINITY;
    }
    for (int i = 0; i < RAYS; i++) {
        /* The first window starts at two places, the rest anywhere. */
        const float there = (float)(i % 2) / 2 + (float)(i % 64) / 1000;
        mixed[i] = i < 512 ? ray_down(0.1f + there, 0.2f) : rays[i * 127 % RAYS];
        mixed[i].direction[1] = (float)(i % 5) / 10;
    }
}

int main(int argc, char **argv)
{
    const bool is_part = argc > 1 && strcmp(argv[1], "part") == 0;
    make_rays();
    /* The builds come first: the queries use the grid that they leave. */
    struct {
        const char *name;
        void (*call)(void);
        /* The blob of the one tree that the call walks; NULL if there are more. */
        void *const *blob;
        size_t most, most_few;
    } calls[] = {{"build", build, NULL, 0, 0}, {"tasks", tasks, NULL, 0, 0}, {"one", one, &by_one_task.index, 0, 0},
                 {"options", with_options, &by_one_task.index, 0, 0}, {"closest", closest, &by_one_task.index, 0, 0},
                 {"many", many, &by_one_task.index, 0, 0}, {"scenes", build_scenes, NULL, 0, 0},
                 {"scene", flat_scene, NULL, 0, 0}, {"nested", nested_scenes, NULL, 0, 0},
                 {"scene_many", flat_scene_together, NULL, 0, 0}, {"nested_many", nested_scenes_together, NULL, 0, 0},
                 {"shapes", boxes_of_triangles, &shapes_index, 0, 0},
                 {"shapes_many", boxes_of_triangles_together, &shapes_index, 0, 0}};
    uint32_t most_levels = 0;
    enum { CALLS = sizeof calls / sizeof *calls };
    for (uint32_t number = 0; number < MESHES; number++)
        for (int method = 0; method <= METHODS; method++) {
            if (number >= TANGLED && method < METHODS - 1)
                continue;
            /* Grids over crowds need no more stack and take half a minute. */
            if (is_part && !is_of_part(number, method))
                continue;
            is_slow = number >= TANGLED;
            mesh = mesh_number(number);
            by_one_task = job_of(method, 1), by_many_tasks = job_of(method, HGRID_MAX_TASKS);
            for (int i = 0; i < CALLS; i++) {
                /* The other methods always build with one task. */
                if (calls[i].call == tasks && by_many_tasks.config.method != HGRID_METHOD_BVH)
                    continue;
                const size_t bytes = stack_of(calls[i].call);
                calls[i].most = bytes > calls[i].most ? bytes : calls[i].most;
                const uint32_t levels = calls[i].blob ? levels_of(*calls[i].blob) : 0;
                most_levels = levels > most_levels ? levels : most_levels;
                if (levels > 0 && levels <= FEW_LEVELS)
                    calls[i].most_few = bytes > calls[i].most_few ? bytes : calls[i].most_few;
            }
        }
    for (int i = 0; i < CALLS; i++) {
        printf("%s %zu\n", calls[i].name, calls[i].most);
        if (calls[i].blob)
            printf("%s_few %zu\n", calls[i].name, calls[i].most_few);
    }
    printf("levels %u\n", (unsigned)most_levels);
    printf("task %zu\n", most_of_a_task);
    return 0;
}
