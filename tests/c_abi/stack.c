/* Prints how much stack queries take, in bytes, one "name most" a line: the most of all methods, on
 * a stack that was filled before. */

#include "check.h"

#include <ucontext.h>

enum { RAYS = 640, STACK = 256 * 1024 };

static hgrid_grid grid;
static hgrid_ray rays[RAYS];
static hgrid_hit hits[RAYS];
static uint8_t occluded[RAYS];
static hgrid_coherence coherence;

static void one(void)
{
    for (int i = 0; i < RAYS; i++) {
        hgrid_intersect(&grid, &rays[i], NULL, &hits[i]);
        hgrid_occluded(&grid, &rays[i], NULL);
    }
}

static void many(void)
{
    CHECK(hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, coherence, NULL) == HGRID_OK);
    CHECK(hgrid_occluded_n(&grid, rays, 0, occluded, 0, RAYS, coherence, NULL) == HGRID_OK);
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
    const hgrid_config configs[] = {HGRID_CONFIG_INIT, HGRID_CONFIG_INIT_FIXED,
                                    HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE,
                                    HGRID_CONFIG_INIT_BRICK};
    for (int i = 0; i < RAYS; i++) {
        /* Tiles, some of them with rays that go elsewhere. */
        const int tile = i / 64, pixel = i % 64;
        rays[i] = ray_down((float)(tile % 4 * 8 + pixel % 8) / 32,
                           (float)(tile / 4 * 8 + pixel / 8) / 32);
        rays[i].direction[0] = tile > 4 && i % 7 == 0 ? -3.0f : 0.1f;
    }
    size_t most_of_one = 0, most_of_many = 0;
    for (size_t i = 0; i < sizeof configs / sizeof *configs; i++) {
        const hgrid_report need = exact_sizes(&mesh, &configs[i]);
        void *index = guarded(need.index_bytes), *scratch = guarded(need.scratch_bytes);
        CHECK(hgrid_build(&mesh, &configs[i], index, need.index_bytes, scratch, need.scratch_bytes,
                          &grid, NULL) == HGRID_OK);
        const size_t bytes = stack_of(one);
        most_of_one = bytes > most_of_one ? bytes : most_of_one;
        for (coherence = 0; coherence < 2; coherence++) {
            const size_t batch = stack_of(many);
            most_of_many = batch > most_of_many ? batch : most_of_many;
        }
    }
    printf("one %zu\nmany %zu\n", most_of_one, most_of_many);
    return 0;
}
