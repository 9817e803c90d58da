/* A build reports its progress from nothing to the end, and stops when the callback says so. */

#include "check.h"

#include <pthread.h>

static sheet mesh_data;
static hgrid_mesh mesh;

/* Says stop at a call, counted from 0, and checks that none follows. */
typedef struct {
    size_t stop_at, calls;
    uint32_t last;
    pthread_t thread;
} watcher;

static bool watch(void *context, uint32_t done)
{
    watcher *w = (watcher *)context;
    CHECK(pthread_equal(w->thread, pthread_self()));
    CHECK(w->calls <= w->stop_at);
    CHECK(done <= HGRID_PROGRESS_END && (w->calls == 0 ? done == 0 : done > w->last));
    w->last = done;
    return w->calls++ < w->stop_at;
}

static watcher watcher_of(size_t stop_at)
{
    const watcher w = {stop_at, 0, 0, pthread_self()};
    return w;
}

/* Runs tasks on the thread that builds. */
static void run(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    for (uint32_t i = 0; i < count; i++)
        task(task_context, i);
    CHECK(context != NULL);
}

static void every_call_may_cancel(const hgrid_config *plain, uint32_t tasks)
{
    watcher w = watcher_of(SIZE_MAX);
    hgrid_config config = *plain;
    config.tasks = tasks, config.run = run, config.progress = watch, config.context = &w;
    hgrid_report need = HGRID_REPORT_INIT, report = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, NULL, 0, &need));
    const size_t index_bytes = (size_t)need.index_bytes;
    const size_t scratch_bytes = (size_t)need.scratch_bytes;
    void *index = guarded(index_bytes), *scratch = guarded(scratch_bytes);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, scratch, scratch_bytes, &report));
    CHECK(w.calls == 0);

    EXPECT(HGRID_OK, hgrid_build(&mesh, &config, index, index_bytes, scratch, scratch_bytes, &grid,
                                 &report));
    CHECK(w.last == HGRID_PROGRESS_END && w.calls > 2);
    const size_t calls = w.calls, bytes = (size_t)report.index_bytes;
    void *expected = guarded_copy(index, bytes);

    /* The answer to the last call is ignored: the grid is complete by then. */
    w = watcher_of(calls - 1);
    EXPECT(HGRID_OK, hgrid_build(&mesh, &config, index, index_bytes, scratch, scratch_bytes, &grid,
                                 NULL));
    CHECK(w.last == HGRID_PROGRESS_END && w.calls == calls);
    CHECK(memcmp(index, expected, bytes) == 0);

    for (size_t stop_at = 0; stop_at + 1 < calls; stop_at++) {
        w = watcher_of(stop_at);
        memset(&grid, 0xc7, sizeof grid);
        memset(index, 0xc7, index_bytes);
        EXPECT(HGRID_ERROR_CANCELLED, hgrid_build(&mesh, &config, index, index_bytes, scratch,
                                                  scratch_bytes, &grid, &report));
        CHECK(w.last < HGRID_PROGRESS_END && w.calls == stop_at + 1);
        CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
        CHECK(report.index_bytes == 0 && report.triangle == HGRID_INVALID_ID);
        /* The bytes left in the index do not open as a grid, nor do they disturb the next build. */
        CHECK(hgrid_open(index, index_bytes, &mesh, &grid) != HGRID_OK);
        w = watcher_of(SIZE_MAX);
        EXPECT(HGRID_OK, hgrid_build(&mesh, &config, index, index_bytes, scratch, scratch_bytes,
                                     &grid, NULL));
        CHECK(memcmp(index, expected, bytes) == 0);
    }
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        every_call_may_cancel(&config, 1);
        every_call_may_cancel(&config, 4);
    }
    return 0;
}
