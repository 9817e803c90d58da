#include "measure.h"

#include "scene.h"
#include "start.h"

/* The Makefile sets the instructions that QEMU runs in a tick; on a board a tick is a cycle. */
#ifdef INSTRUCTIONS_PER_TICK
#define WORK " instructions"
#else
#define INSTRUCTIONS_PER_TICK 1
#define WORK " cycles"
#endif

void tell(const char *name, const char *unit, uint32_t ticks_before, uint32_t count)
{
    const uint32_t work = (ticks() - ticks_before) * INSTRUCTIONS_PER_TICK / count;
    const uint32_t stack = (uint32_t)used_stack();
    print(name), print(": "), print_number(work), print(WORK " a "), print(unit), print(", ");
    print_number(stack), print(" bytes of stack\n");
}

/* Adds the words of a hit to an FNV-1a sum. */
static uint64_t add(uint64_t sum, const hgrid_hit *hit)
{
    union {
        hgrid_hit hit;
        uint32_t words[sizeof(hgrid_hit) / sizeof(uint32_t)];
    } both;
    both.hit = *hit;
    for (size_t i = 0; i < sizeof both.words / sizeof *both.words; i++)
        sum = (sum ^ both.words[i]) * 0x100000001b3u;
    return sum;
}

void trace(const hgrid_grid *grid)
{
    static hgrid_ray rays[RAYS];
    static hgrid_hit hits[RAYS];
    uint32_t found = 0, blocked = 0;
    /* A ray that misses writes nothing, so its hit keeps this number, which no triangle has. */
    for (int i = 0; i < RAYS; i++)
        rays[i] = camera_ray(i), hits[i].primitive = HGRID_INVALID_ID;

    paint_stack();
    uint32_t before = ticks();
    for (int i = 0; i < RAYS; i++)
        found += hgrid_intersect(grid, &rays[i], NULL, &hits[i]);
    tell("closest hit", "ray", before, RAYS);

    uint64_t sum = 0xcbf29ce484222325u;
    for (int i = 0; i < RAYS; i++)
        if (hits[i].primitive != HGRID_INVALID_ID)
            sum = add(sum, &hits[i]);

    paint_stack();
    before = ticks();
    for (int i = 0; i < RAYS; i++)
        blocked += hgrid_occluded(grid, &rays[i], NULL);
    tell("any hit", "ray", before, RAYS);

    paint_stack();
    before = ticks();
    for (int i = 0; i < RAYS / 4; i++) {
        const hgrid_point_query query = {{(float)(i % 8) * 4, (float)(i / 8) * 6, 3}, 100};
        hgrid_closest closest;
        hgrid_closest_point(grid, &query, NULL, &closest);
    }
    tell("closest point", "point", before, RAYS / 4);

    print_number(found), print(" rays of "), print_number(RAYS), print(" hit");
    print(found == blocked ? "; sum of the hits " : "; but not if asked for any hit: ");
    print_sum(sum), print("\n");
}
