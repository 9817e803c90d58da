/* Prints how much stack queries take, in bytes, one "name most" a line: the most of all methods, on
 * a stack that was filled before. */

#include "check.h"

#include <ucontext.h>

enum { RAYS = 640, STACK = 256 * 1024 };

static hgrid_grid grid;
static hgrid_ray rays[RAYS];
static hgrid_hit hits[RAYS];
static uint8_t occluded[RAYS];
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
        hgrid_closest found;
        hgrid_closest_point(&grid, rays[i].origin, INFINITY, NULL, &found);
    }
}

static void many(void)
{
    const hgrid_query_options all = options();
    for (hgrid_coherence c = 0; c < 2; c++) {
        CHECK(hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, c, NULL) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, rays, 0, occluded, 0, RAYS, c, NULL) == HGRID_OK);
        CHECK(hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, c, &all) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, rays, 0, occluded, 0, RAYS, c, &all) == HGRID_OK);
    }
}

/* Bytes of stack that a call takes. */
static size_t stack_of(void (*call)(void))
{
    static unsigned char stack[STACK];
    static ucontext_t here, there;
    memset(stack, 0xc7, sizeof stack);
    CHECK(getcontext(&there) == 0);
    there.uc_stack.ss_sp = stack;
    there.uc_stack.ss_size = sizeof stack;
    there.uc_link = &here;
    makecontext(&there, call, 0);
    CHECK(swapcontext(&here, &there) == 0);
    size_t unused = 0;
    while (unused < sizeof stack && stack[unused] == 0xc7)
        unused++;
    return sizeof stack - unused;
}

int main(void)
{
    static sheet data;
    make_sheet(&data);
    const hgrid_mesh mesh = mesh_of(&data);
    for (int i = 0; i < RAYS; i++) {
        /* Tiles, some of them with rays that go elsewhere. */
        const int tile = i / 64, pixel = i % 64;
        rays[i] = ray_down((float)(tile % 4 * 8 + pixel % 8) / 32,
                           (float)(tile / 4 * 8 + pixel / 8) / 32);
        rays[i].direction[0] = tile > 4 && i % 7 == 0 ? -3.0f : 0.1f;
    }
    struct {
        const char *name;
        void (*call)(void);
        size_t most;
    } calls[] = {{"one", one, 0}, {"options", with_options, 0}, {"closest", closest, 0},
                 {"many", many, 0}};
    enum { CALLS = sizeof calls / sizeof *calls };
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        grid = build_exactly(&mesh, &config, NULL, NULL);
        for (int i = 0; i < CALLS; i++) {
            const size_t bytes = stack_of(calls[i].call);
            calls[i].most = bytes > calls[i].most ? bytes : calls[i].most;
        }
    }
    for (int i = 0; i < CALLS; i++)
        printf("%s %zu\n", calls[i].name, calls[i].most);
    return 0;
}
