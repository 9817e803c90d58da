/* Eight threads run all queries on one grid at once, each with answers and counters of its own, and build
 * grids of their own meanwhile: the answers are those of a single thread. Also for tools that check threads.
 * */

#include "check.h"

#include <pthread.h>

enum { THREADS = 8, RAYS = 80, ROOM = 4 };

static sheet mesh_data;
static uint32_t masks[TRIANGLES];
static hgrid_mesh mesh;
static hgrid_grid grid;
static hgrid_config config;
static hgrid_report need;
static void *blob;
static size_t blob_bytes, packed_bytes;
static hgrid_ray rays[RAYS];
static pthread_barrier_t barrier;

/* The answers of all queries. Zeroed before use, so that whole structs can be compared. */
typedef struct {
    hgrid_hit hits[RAYS], filtered[RAYS], all[RAYS][ROOM], batches[2][RAYS], seen[RAYS];
    uint8_t occluded[RAYS], occluded_batches[2][RAYS];
    size_t counts[RAYS], offers;
    hgrid_closest closest[RAYS];
    hgrid_counters counters[5];
    hgrid_statistics statistics;
    hgrid_blob_info info;
    hgrid_status validated, packed, opened, built;
} answers;

/* The regions of a thread. */
typedef struct {
    pthread_t thread;
    unsigned char *index, *scratch, *packed;
    answers *found;
} worker;

static hgrid_verdict odd_ones(void *context, size_t place, const hgrid_hit *hit)
{
    size_t *offers = (size_t *)context;
    *offers += place + 1;
    return hit->primitive % 2 == 0 ? HGRID_REJECT : HGRID_ACCEPT;
}

static void ask_about_rays(answers *a)
{
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT, filtering = HGRID_QUERY_OPTIONS_INIT;
    filtering.filter = odd_ones, filtering.context = &a->offers;
    options.mask = 6, options.cull = HGRID_CULL_BACK, options.skip = 40;
    for (int i = 0; i < RAYS; i++) {
        options.counters = &a->counters[0];
        hgrid_intersect(&grid, &rays[i], &options, &a->hits[i]);
        a->occluded[i] = hgrid_occluded(&grid, &rays[i], &options);
        options.counters = &a->counters[1];
        CHECK(hgrid_intersect_all(&grid, &rays[i], &options, a->all[i], ROOM, &a->counts[i]) ==
              HGRID_OK);
        options.counters = &a->counters[2];
        const hgrid_point_query query = anywhere(rays[i].origin);
        hgrid_closest_point(&grid, &query, &options, &a->closest[i]);
        filtering.counters = &a->counters[3];
        hgrid_intersect(&grid, &rays[i], &filtering, &a->filtered[i]);
    }
}

static void ask_about_batches(answers *a)
{
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    for (hgrid_coherence c = 0; c < 2; c++) {
        options.counters = c == 0 ? &a->counters[4] : NULL;
        CHECK(hgrid_intersect_n(&grid, rays, 0, a->batches[c], 0, RAYS, c, &options) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, rays, 0, a->occluded_batches[c], 0, RAYS, c, NULL) ==
              HGRID_OK);
    }
    options.filter = odd_ones, options.context = &a->offers, options.counters = &a->counters[4];
    CHECK(hgrid_intersect_n(&grid, rays, 0, a->seen, 0, RAYS, 1, &options) == HGRID_OK);
}

static void ask_about_the_grid(answers *a, const worker *w)
{
    const hgrid_statistics statistics = HGRID_STATISTICS_INIT;
    const hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    hgrid_grid view;
    uint64_t bytes;
    a->statistics = statistics, a->info = info;
    CHECK(hgrid_inspect(&grid, &a->statistics) == HGRID_OK);
    CHECK(hgrid_peek(blob, blob_bytes, &a->info) == HGRID_OK);
    a->validated = proof(&grid);
    a->packed = hgrid_pack(&grid, w->packed, packed_bytes, &bytes);
    a->opened = hgrid_open(blob, blob_bytes, &mesh, &view);
    CHECK(hgrid_occluded(&view, &rays[33], NULL) == hgrid_occluded(&grid, &rays[33], NULL));
    a->built = hgrid_build(&mesh, &config, w->index, (size_t)need.index_bytes, w->scratch,
                           (size_t)need.scratch_bytes, &view, NULL);
    CHECK(memcmp(w->index, blob, blob_bytes) == 0);
}

static void *work(void *argument)
{
    worker *w = (worker *)argument;
    const int result = pthread_barrier_wait(&barrier);
    CHECK(result == 0 || result == PTHREAD_BARRIER_SERIAL_THREAD);
    ask_about_rays(w->found);
    ask_about_batches(w->found);
    ask_about_the_grid(w->found, w);
    return NULL;
}

static worker new_worker(void)
{
    worker w;
    w.index = (unsigned char *)guarded((size_t)need.index_bytes);
    w.scratch = (unsigned char *)guarded((size_t)need.scratch_bytes);
    w.packed = (unsigned char *)guarded(packed_bytes);
    w.found = (answers *)calloc(1, sizeof *w.found);
    CHECK(w.found != NULL);
    return w;
}

static void check_method(int method)
{
    config = usual(method);
    need = exact_sizes(&mesh, &config);
    grid = build_exactly(&mesh, &config, &blob, &blob_bytes);
    uint64_t bytes;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(&grid, NULL, 0, &bytes));
    packed_bytes = (size_t)bytes;

    worker alone = new_worker(), workers[THREADS];
    CHECK(pthread_barrier_init(&barrier, NULL, 1) == 0);
    work(&alone);
    CHECK(pthread_barrier_destroy(&barrier) == 0);
    CHECK(alone.found->validated == HGRID_OK && alone.found->built == HGRID_OK);
    CHECK(alone.found->packed == HGRID_OK && alone.found->opened == HGRID_OK);
    for (int i = 0; i < 5; i++)
        CHECK(alone.found->counters[i].primitive_tests > 0);

    CHECK(pthread_barrier_init(&barrier, NULL, THREADS) == 0);
    for (int i = 0; i < THREADS; i++) {
        workers[i] = new_worker();
        CHECK(pthread_create(&workers[i].thread, NULL, work, &workers[i]) == 0);
    }
    for (int i = 0; i < THREADS; i++) {
        CHECK(pthread_join(workers[i].thread, NULL) == 0);
        CHECK(memcmp(workers[i].found, alone.found, sizeof *alone.found) == 0);
        CHECK(memcmp(workers[i].packed, alone.packed, packed_bytes) == 0);
        free(workers[i].found);
    }
    CHECK(pthread_barrier_destroy(&barrier) == 0);
    free(alone.found);
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    for (uint32_t i = 0; i < TRIANGLES; i++)
        masks[i] = i % 7;
    mesh.masks = masks;
    for (int i = 0; i < RAYS; i++) {
        rays[i] = ray_down((float)(i % 10) / 9.3f, (float)(i / 10) / 7.7f);
        rays[i].direction[0] = (float)(i % 5 - 2);
    }
    for (int method = 0; method < METHODS; method++)
        check_method(method);
    return 0;
}
