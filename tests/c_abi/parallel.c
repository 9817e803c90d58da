/* A parallel build makes the bytes of the serial one, and a broken loop over tasks is an error. With an
 * argument, a part of the numbers of tasks, of the broken loops and of the methods. */

#include "check.h"

#include <pthread.h>

/* A sheet large enough for four tasks: no task has fewer than 16 384 triangles. */
enum { WIDE = 182, WIDE_VERTICES = (WIDE + 1) * (WIDE + 1), WIDE_TRIANGLES = 2 * WIDE * WIDE };

static float positions[WIDE_VERTICES][3];
static uint32_t indices[WIDE_TRIANGLES][3];
static hgrid_mesh mesh;
static const hgrid_config serially = HGRID_CONFIG_INIT;
static bool is_part;
static size_t serial_bytes;
static unsigned char *serial;

static void make_mesh(void)
{
    const hgrid_mesh empty = HGRID_MESH_INIT;
    for (uint32_t y = 0; y <= WIDE; y++)
        for (uint32_t x = 0; x <= WIDE; x++) {
            float *p = positions[y * (WIDE + 1) + x];
            p[0] = (float)x / (float)WIDE;
            p[1] = (float)y / (float)WIDE;
            p[2] = (float)((x * 5 + y * 3) % 7) / 70;
        }
    for (uint32_t y = 0; y < WIDE; y++)
        for (uint32_t x = 0; x < WIDE; x++) {
            const uint32_t a = y * (WIDE + 1) + x, b = a + 1, d = a + WIDE + 1, c = d + 1;
            const uint32_t square[2][3] = {{a, b, c}, {a, c, d}};
            memcpy(indices[2 * (y * WIDE + x)], square, sizeof square);
        }
    mesh = empty;
    mesh.positions = positions, mesh.vertex_count = WIDE_VERTICES;
    mesh.indices = indices, mesh.triangle_count = WIDE_TRIANGLES;
}

/* The ways in which a loop runs the tasks of one of its calls. */
typedef enum {
    ONCE,
    BACKWARDS,
    /* All that follow are broken. */
    NEVER,
    FIRST_NEVER,
    LAST_NEVER,
    FIRST_TWICE,
    ALL_TWICE_AT_ONCE,
    FIRST_INSTEAD_OF_ALL,
    ONE_TOO_MANY,
    FAR_OUT,
    WITHOUT_CONTEXT,
    LOOPS
} loop;

typedef struct {
    loop which;
    /* The number of the call that does so; the others are correct. */
    uint32_t at;
    uint32_t call_count;
    uint32_t most_tasks;
} plan;

typedef struct {
    pthread_t thread;
    hgrid_task task;
    void *task_context;
    uint32_t index;
} one_task;

static void *run_one(void *argument)
{
    const one_task *one = (const one_task *)argument;
    one->task(one->task_context, one->index);
    return NULL;
}

/* Calls a task with each of the indices, each on a thread of its own, all at once. */
static void on_threads(const uint32_t *list, uint32_t count, hgrid_task task, void *task_context)
{
    one_task all[2 * HGRID_MAX_TASKS];
    for (uint32_t i = 0; i < count; i++) {
        all[i].task = task, all[i].task_context = task_context, all[i].index = list[i];
        CHECK(pthread_create(&all[i].thread, NULL, run_one, &all[i]) == 0);
    }
    for (uint32_t i = 0; i < count; i++)
        CHECK(pthread_join(all[i].thread, NULL) == 0);
}

static void run(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    plan *p = (plan *)context;
    const loop which = p->call_count == p->at ? p->which : ONCE;
    uint32_t list[2 * HGRID_MAX_TASKS], length = count;
    CHECK(count > 0 && count <= HGRID_MAX_TASKS);
    p->call_count++;
    p->most_tasks = count > p->most_tasks ? count : p->most_tasks;
    for (uint32_t i = 0; i < count; i++) {
        list[i] = which == BACKWARDS ? count - 1 - i : i;
        list[count + i] = i;
    }
    switch (which) {
    case NEVER: length = 0; break;
    case FIRST_NEVER: list[0] = list[--length]; break;
    case LAST_NEVER: length--; break;
    case FIRST_TWICE: list[length++] = 0; break;
    case ALL_TWICE_AT_ONCE: length *= 2; break;
    case FIRST_INSTEAD_OF_ALL: memset(list, 0, sizeof list), length++; break;
    case ONE_TOO_MANY: list[length++] = count; break;
    case FAR_OUT: list[length++] = UINT32_MAX; break;
    case WITHOUT_CONTEXT: task_context = NULL; break;
    default: break;
    }
    on_threads(list, length, task, task_context);
}

/* Returns a configuration whose tasks run as planned. */
static hgrid_config in_parallel(hgrid_config config, plan *p, uint32_t tasks)
{
    config.tasks = tasks;
    config.context = p;
    config.run = run;
    return config;
}

static plan plan_of(loop which, uint32_t at)
{
    const plan p = {which, at, 0, 0};
    return p;
}

static void build_serially(void)
{
    const hgrid_report need = exact_sizes(&mesh, &serially);
    void *scratch = guarded((size_t)need.scratch_bytes);
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    serial = (unsigned char *)guarded((size_t)need.index_bytes);
    EXPECT(HGRID_OK, hgrid_build(&mesh, &serially, serial, (size_t)need.index_bytes, scratch,
                                 (size_t)need.scratch_bytes, &grid, &report));
    serial_bytes = (size_t)report.index_bytes;
}

/* Builds in memory of the reported size: the blob must be the serial one. */
static void check_build(const hgrid_config *config)
{
    hgrid_report enough = HGRID_REPORT_INIT, exact = HGRID_REPORT_INIT, report = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, config, NULL, 0, &enough));
    const size_t scratch_bytes = (size_t)enough.scratch_bytes;
    void *scratch = guarded(scratch_bytes);
    EXPECT(HGRID_OK,
           hgrid_sizes(&mesh, config, scratch, scratch_bytes, &exact));
    CHECK(exact.index_bytes <= enough.index_bytes);
    const size_t index_bytes = (size_t)exact.index_bytes;
    void *index = guarded(index_bytes);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, config, index, index_bytes, scratch,
                                          scratch_bytes, &grid, &report));
    CHECK(report.index_bytes == serial_bytes && report.is_exact == 1);
    CHECK(memcmp(index, serial, serial_bytes) == 0);
    EXPECT_PROOF(HGRID_OK, &grid);
}

/* More tasks than there may be need no more memory. */
static void bounds_are_those_of_as_many_tasks_as_there_may_be(void)
{
    const uint32_t counts[] = {1, HGRID_MAX_TASKS, HGRID_MAX_TASKS + 1, UINT32_MAX};
    uint64_t scratch[4], of_scene[4];
    for (int i = 0; i < 4; i++) {
        plan nobody = plan_of(ONCE, 1);
        const hgrid_config config = in_parallel(serially, &nobody, counts[i]);
        hgrid_report bound = HGRID_REPORT_INIT;
        EXPECT(HGRID_OK, hgrid_bound(mesh.triangle_count, &config, &bound));
        scratch[i] = bound.scratch_bytes;
        EXPECT(HGRID_OK, hgrid_scene_bound(mesh.triangle_count, &config, &bound));
        of_scene[i] = bound.scratch_bytes;
    }
    CHECK(scratch[0] < scratch[1] && of_scene[0] < of_scene[1]);
    for (int i = 2; i < 4; i++)
        CHECK(scratch[i] == scratch[1] && of_scene[i] == of_scene[1]);
}

static void any_number_of_tasks_builds_the_same_bytes(void)
{
    bounds_are_those_of_as_many_tasks_as_there_may_be();
    check_build(&serially);
    const uint32_t more[] = {13, HGRID_MAX_TASKS, HGRID_MAX_TASKS + 1, UINT32_MAX};
    for (uint32_t i = 0; i < 9 + sizeof more / sizeof *more; i++) {
        const uint32_t tasks = i < 9 ? i : more[i - 9];
        if (is_part && i % 4 != 0)
            continue;
        for (int which = ONCE; which <= BACKWARDS; which++) {
            plan p = plan_of((loop)which, 1);
            const hgrid_config config = in_parallel(serially, &p, tasks);
            check_build(&config);
            CHECK((p.call_count > 0) == (tasks > 1));
            CHECK(p.most_tasks <= tasks);
            CHECK(tasks < 2 || p.most_tasks == (tasks < 4 ? tasks : 4));
        }
    }
}

/* Builds with a configuration in memory of the exact size; returns the blob. */
static unsigned char *built(const hgrid_config *config, const hgrid_report *need)
{
    const size_t index_bytes = (size_t)need->index_bytes, scratch_bytes = (size_t)need->scratch_bytes;
    unsigned char *index = (unsigned char *)guarded(index_bytes);
    void *scratch = guarded(scratch_bytes);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, config, scratch, scratch_bytes, &report));
    CHECK(report.index_bytes == need->index_bytes);
    EXPECT(HGRID_OK, hgrid_build(&mesh, config, index, index_bytes, scratch, scratch_bytes, &grid, NULL));
    return index;
}

/* The other methods ignore tasks: they never call the loop, and build the same bytes without it. methods.c
 * validates small grids of theirs. */
static void other_methods_call_nothing(void)
{
    const hgrid_config others[] = {HGRID_CONFIG_INIT_ONE_LEVEL, HGRID_CONFIG_INIT_FIXED,
                                   HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE};
    plan p = plan_of(NEVER, 0);
    /* Half of the sheet, so that recursive grids are built sooner; a tree over it would still use two tasks. */
    mesh.triangle_count = WIDE_TRIANGLES / 2;
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        /* The recursive method takes six times as long as all the rest together. */
        if (is_part && others[i].method == HGRID_METHOD_RECURSIVE)
            continue;
        const hgrid_config config = in_parallel(others[i], &p, 4);
        const hgrid_report need = exact_sizes(&mesh, &others[i]);
        CHECK(memcmp(built(&config, &need), built(&others[i], &need), (size_t)need.index_bytes) == 0);
    }
    mesh.triangle_count = WIDE_TRIANGLES;
    CHECK(p.call_count == 0);
}

static void scratch_for_one_task_is_enough(void)
{
    hgrid_report need = HGRID_REPORT_INIT, wanted = HGRID_REPORT_INIT;
    plan p = plan_of(ONCE, 0);
    const hgrid_config parallel = in_parallel(serially, &p, 8);
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &serially, NULL, 0, &need));
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &parallel, NULL, 0, &wanted));
    CHECK(need.scratch_bytes < wanted.scratch_bytes);

    const size_t index_bytes = (size_t)wanted.index_bytes;
    void *index = guarded(index_bytes);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL,
           hgrid_build(&mesh, &parallel, index, index_bytes, NULL, 0, &grid,
                                &report));
    CHECK(report.scratch_bytes <= need.scratch_bytes && report.index_bytes > 0);
    const size_t scratch_bytes = (size_t)report.scratch_bytes;
    void *scratch = guarded(scratch_bytes);
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL,
           hgrid_build(&mesh, &parallel, NULL, 0, scratch, scratch_bytes, &grid,
                                &report));
    CHECK(report.index_bytes <= index_bytes && report.scratch_bytes >= scratch_bytes);
    EXPECT(HGRID_OK, hgrid_build(&mesh, &parallel, index, index_bytes, scratch,
                                          scratch_bytes, &grid, NULL));
    CHECK(memcmp(index, serial, serial_bytes) == 0);
}

static void a_broken_loop_is_an_error(void)
{
    plan good = plan_of(ONCE, 0);
    const hgrid_config working = in_parallel(serially, &good, 4);
    hgrid_report need = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &working, NULL, 0, &need));
    const size_t index_bytes = (size_t)need.index_bytes;
    const size_t scratch_bytes = (size_t)need.scratch_bytes;
    void *index = guarded(index_bytes), *scratch = guarded(scratch_bytes);
    hgrid_grid grid;
    good.call_count = 0;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &working, index, index_bytes, scratch,
                                          scratch_bytes, &grid, NULL));
    const uint32_t call_count = good.call_count;
    CHECK(call_count > 1);

    for (int which = NEVER; which < LOOPS; which++)
        for (uint32_t at = 0; at < call_count; at++) {
            /* For a part, try each loop and each call once. */
            if (is_part && (uint32_t)which % call_count != at)
                continue;
            plan p = plan_of((loop)which, at);
            const hgrid_config broken = in_parallel(serially, &p, 4);
            hgrid_report report = HGRID_REPORT_INIT;
            memset(&grid, 0xc7, sizeof grid);
            EXPECT(HGRID_ERROR_PARALLEL_FOR,
                   hgrid_build(&mesh, &broken, index, index_bytes, scratch,
                                        scratch_bytes, &grid, &report));
            CHECK(p.call_count == at + 1);
            CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
            CHECK(report.index_bytes == 0 && report.triangle == HGRID_INVALID_ID);

            /* Sizes for several tasks are a bound, which calls no loop. */
            p.call_count = 0;
            EXPECT(HGRID_OK, hgrid_sizes(&mesh, &broken, scratch, scratch_bytes, &report));
            CHECK(p.call_count == 0);
            EXPECT(HGRID_OK, hgrid_build(&mesh, &working, index, index_bytes,
                                                  scratch, scratch_bytes, &grid, NULL));
            CHECK(memcmp(index, serial, serial_bytes) == 0);
        }
}

static void run_is_null_only_for_one_task(void)
{
    hgrid_config config = serially;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    config.tasks = 0;
    check_build(&config);
    config.tasks = 2;
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_sizes(&mesh, &config, NULL, 0, &report));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT,
           hgrid_build(&mesh, &config, NULL, 0, NULL, 0, &grid, &report));
}

int main(int argc, char **argv)
{
    (void)argv;
    is_part = argc > 1;
    make_mesh();
    build_serially();
    any_number_of_tasks_builds_the_same_bytes();
    other_methods_call_nothing();
    a_broken_loop_is_an_error();
    run_is_null_only_for_one_task();
    scratch_for_one_task_is_enough();
    return 0;
}
