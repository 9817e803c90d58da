/* Query options, all hits of a ray, and the closest point: which values are refused, what stays untouched,
 * and what a filter may do. answers.c checks that the answers are right. */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static const hgrid_ray ray = {{0.4f, 0.3f, 1}, 0, {0, 0, -1}, INFINITY};
static const hgrid_query_options defaults = HGRID_QUERY_OPTIONS_INIT;

static void build(int method)
{
    static uint32_t masks[TRIANGLES];
    const hgrid_config config = usual(method);
    make_sheet(&mesh_data);
    for (uint32_t i = 0; i < TRIANGLES; i++)
        masks[i] = i % 2 == 0 ? 0x80000001u : 0;
    mesh = mesh_of(&mesh_data);
    mesh.masks = masks;
    grid = build_exactly(&mesh, &config, NULL, NULL);
}

/* Checks that every query refuses the options, counts nothing and finds nothing. */
static void refuse(hgrid_status expected, const hgrid_query_options *options)
{
    const hgrid_point_query query = {{0.4f, 0.3f, 1}, INFINITY};
    const hgrid_coherence c = HGRID_COHERENCE_INCOHERENT;
    struct {
        hgrid_hit hit;
        hgrid_closest closest;
        uint8_t occluded;
        uint32_t occluder;
        size_t count;
    } out;
    memset(&out, 0xc7, sizeof out);
    CHECK(!hgrid_intersect(&grid, &ray, options, &out.hit));
    CHECK(!hgrid_occluded(&grid, &ray, options));
    CHECK(hgrid_occluder(&grid, &ray, options) == HGRID_INVALID_ID);
    CHECK(!hgrid_closest_point(&grid, &query, options, &out.closest));
    EXPECT(expected, hgrid_intersect_all(&grid, &ray, options, &out.hit, 1, &out.count));
    EXPECT(expected, hgrid_intersect_n(&grid, &ray, 0, &out.hit, 0, 1, c, options));
    EXPECT(expected, hgrid_occluded_n(&grid, &ray, 0, &out.occluded, 0, 1, c, options));
    EXPECT(expected, hgrid_occluder_n(&grid, &ray, 0, &out.occluder, 0, 1, c, options));
    CHECK(all_bytes_are(&out, sizeof out, 0xc7));
}

static void unknown_sides_are_refused(void)
{
    const uint32_t unknown[] = {3, 4, 0x80000000u, UINT32_MAX};
    hgrid_counters counters = {1, 2, 3};
    hgrid_query_options options = defaults;
    options.counters = &counters;
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++) {
        options.cull = unknown[i];
        refuse(HGRID_ERROR_INVALID_CULL, &options);
    }
    options.cull = HGRID_CULL_NONE;
    options.struct_size--;
    refuse(HGRID_ERROR_STRUCT_SIZE, &options);
    options.struct_size++, options.reserved = 1;
    refuse(HGRID_ERROR_STRUCT_SIZE, &options);
    CHECK(counters.primitive_tests == 1 && counters.cell_steps == 2 && counters.grid_steps == 3);
}

/* Seen from above, the sheet shows its front. */
static void sides_are_those_of_the_header(void)
{
    hgrid_query_options options = defaults;
    hgrid_ray below = ray;
    below.origin[2] = -1, below.direction[2] = 1;
    options.cull = HGRID_CULL_BACK;
    CHECK(hgrid_occluded(&grid, &ray, &options) && !hgrid_occluded(&grid, &below, &options));
    options.cull = HGRID_CULL_FRONT;
    CHECK(!hgrid_occluded(&grid, &ray, &options) && hgrid_occluded(&grid, &below, &options));
}

/* The mask of all bits selects even triangles without a bit; other masks select those that share a bit. */
static void masks_are_those_of_the_header(void)
{
    for (uint32_t id = 0; id < TRIANGLES; id++) {
        const uint32_t *corners = mesh_data.indices[id];
        float middle[2] = {0, 0};
        for (int corner = 0; corner < 3; corner++)
            for (int axis = 0; axis < 2; axis++)
                middle[axis] += mesh_data.positions[corners[corner]][axis] / 3;
        const hgrid_ray down = ray_down(middle[0], middle[1]);
        const uint32_t all[] = {UINT32_MAX, 1, 0x80000000u, UINT32_MAX - 1, 2, 0};
        for (int i = 0; i < 6; i++) {
            hgrid_query_options options = defaults;
            options.mask = all[i];
            const bool is_seen = i == 0 || (id % 2 == 0 && i < 4);
            CHECK(hgrid_occluded(&grid, &down, &options) == is_seen);
        }
        hgrid_query_options options = defaults;
        options.skip = id;
        CHECK(!hgrid_occluded(&grid, &down, &options));
        options.skip = (id + 1) % TRIANGLES;
        CHECK(hgrid_occluded(&grid, &down, &options));
    }
}

/* A filter that queries the same grid, and returns a given verdict. */
typedef struct {
    hgrid_verdict verdict;
    int calls;
} inquirer;

static hgrid_verdict inquire(void *context, size_t place, const hgrid_hit *hit)
{
    inquirer *i = (inquirer *)context;
    hgrid_ray back = ray;
    hgrid_hit other;
    hgrid_query_options options = defaults;
    back.direction[2] = 1, back.origin[2] = ray.origin[2] - hit->t;
    options.skip = hit->primitive;
    CHECK(place == 0 && !hgrid_intersect(&grid, &back, &options, &other));
    CHECK(hgrid_intersect(&grid, &ray, NULL, &other) && other.primitive == hit->primitive);
    i->calls++;
    return i->verdict;
}

static void a_filter_may_ask_and_say_anything(void)
{
    const hgrid_verdict verdicts[] = {HGRID_ACCEPT, HGRID_ACCEPT_AND_STOP, HGRID_REJECT, 3,
                                      0x80000001u,  UINT32_MAX};
    for (int v = 0; v < 6; v++) {
        inquirer i = {verdicts[v], 0};
        hgrid_query_options options = defaults;
        options.filter = inquire, options.context = &i;
        hgrid_hit hit;
        size_t count;
        CHECK(hgrid_intersect(&grid, &ray, &options, &hit) == (v < 2) && i.calls == 1);
        CHECK(hgrid_occluded(&grid, &ray, &options) == (v < 2) && i.calls == 2);
        EXPECT(HGRID_OK, hgrid_intersect_all(&grid, &ray, &options, &hit, 1, &count));
        CHECK(count == (v < 2) && i.calls == 3);
    }
}

/* Rejects everything, and counts the calls about triangles with a mask and without. */
static hgrid_verdict reject(void *context, size_t place, const hgrid_hit *hit)
{
    int *calls = (int *)context;
    CHECK(place == 0);
    calls[mesh.masks != NULL && hit->primitive % 2 == 0]++;
    return HGRID_REJECT;
}

/* Filter masks 0 and all bits ask about every triangle, even one whose mask is 0; other values ask about
 * triangles that share a bit, and all others count without a call. */
static void filter_masks_are_those_of_the_header(void)
{
    const hgrid_ray along = {{-1, 0.43f, 0.04f}, 0, {1, 0.01f, 0}, INFINITY};
    const hgrid_coherence c = HGRID_COHERENCE_COHERENT;
    hgrid_hit all[TRIANGLES], some[TRIANGLES], hit;
    size_t count;
    EXPECT(HGRID_OK, hgrid_intersect_all(&grid, &along, NULL, all, TRIANGLES, &count));
    int expected[2] = {0, 0};
    for (size_t i = 0; i < count; i++)
        expected[all[i].primitive % 2 == 0]++;
    CHECK(expected[0] > 1 && expected[1] > 1);

    const uint32_t masks[] = {0, UINT32_MAX, 1, 0x80000002u, 2};
    for (int m = 0; m < 5; m++) {
        int calls[2] = {0, 0};
        hgrid_query_options options = defaults;
        options.filter = reject, options.context = calls, options.filter_mask = masks[m];
        /* All hits: the opaque ones are left, in their order. */
        size_t left = 0, found;
        EXPECT(HGRID_OK, hgrid_intersect_all(&grid, &along, &options, some, TRIANGLES, &found));
        for (size_t i = 0; i < count; i++) {
            const bool is_even = all[i].primitive % 2 == 0;
            const bool is_asked = m < 2 || (m < 4 && is_even);
            if (!is_asked)
                CHECK(memcmp(&all[i], &some[left++], sizeof *all) == 0);
        }
        CHECK(found == left);
        CHECK(calls[0] == (m < 2 ? expected[0] : 0) && calls[1] == (m < 4 ? expected[1] : 0));

        /* Other queries: the first opaque hit, or nothing. */
        uint8_t occluded;
        uint32_t occluder;
        CHECK(hgrid_intersect(&grid, &along, &options, &hit) == (left > 0));
        CHECK(left == 0 || memcmp(&hit, some, sizeof hit) == 0);
        CHECK(hgrid_occluded(&grid, &along, &options) == (left > 0));
        CHECK((hgrid_occluder(&grid, &along, &options) != HGRID_INVALID_ID) == (left > 0));
        EXPECT(HGRID_OK, hgrid_intersect_n(&grid, &along, 0, &hit, 0, 1, c, &options));
        CHECK(left == 0 ? hit.primitive == HGRID_INVALID_ID : memcmp(&hit, some, sizeof hit) == 0);
        EXPECT(HGRID_OK, hgrid_occluded_n(&grid, &along, 0, &occluded, 0, 1, c, &options));
        CHECK(occluded == (left > 0));
        EXPECT(HGRID_OK, hgrid_occluder_n(&grid, &along, 0, &occluder, 0, 1, c, &options));
        CHECK((occluder != HGRID_INVALID_ID) == (left > 0));
    }
}

static void all_hits_are_written_to_their_place(void)
{
    /* A ray along the plane of the sheet hits many triangles. */
    const hgrid_ray along = {{-1, 0.43f, 0.04f}, 0, {1, 0.01f, 0}, INFINITY};
    hgrid_hit all[TRIANGLES];
    size_t count;
    EXPECT(HGRID_OK, hgrid_intersect_all(&grid, &along, NULL, all, TRIANGLES, &count));
    CHECK(count > 6);
    for (size_t i = 1; i < count; i++)
        CHECK(all[i - 1].t < all[i].t ||
              (all[i - 1].t == all[i].t && all[i - 1].primitive < all[i].primitive));
    for (size_t capacity = 0; capacity <= count + 2; capacity++) {
        hgrid_hit *some = (hgrid_hit *)guarded(capacity * sizeof *some);
        size_t again = 77;
        const size_t written = capacity < count ? capacity : count;
        EXPECT(HGRID_OK, hgrid_intersect_all(&grid, &along, NULL, some, capacity, &again));
        CHECK(again == count && memcmp(some, all, written * sizeof *all) == 0);
        CHECK(all_bytes_are(some + written, (capacity - written) * sizeof *some, 0xc7));
    }
    /* More hits than memory can hold. */
    const size_t impossible[] = {SIZE_MAX, SIZE_MAX / 16 + 1, SIZE_MAX / 32 + 1};
    for (size_t i = 0; i < sizeof impossible / sizeof *impossible; i++) {
        count = 77;
        EXPECT(HGRID_ERROR_INVALID_ANSWERS,
               hgrid_intersect_all(&grid, &along, NULL, all, impossible[i], &count));
        CHECK(count == 77);
    }
    /* An invalid ray hits nothing, and a view of zeros is no grid. */
    hgrid_ray none = along;
    none.direction[0] = NAN;
    EXPECT(HGRID_OK, hgrid_intersect_all(&grid, &none, NULL, all, TRIANGLES, &count));
    CHECK(count == 0);
    const hgrid_grid nothing = HGRID_GRID_INIT;
    count = 77;
    EXPECT(HGRID_ERROR_NOT_A_GRID,
           hgrid_intersect_all(&nothing, &along, NULL, all, TRIANGLES, &count));
    CHECK(count == 77);
}

static bool find(const float point[3], float max, const hgrid_query_options *options,
                 hgrid_closest *closest)
{
    memset(closest, 0xc7, sizeof *closest);
    const hgrid_point_query query = {{point[0], point[1], point[2]}, max};
    const bool is_found = hgrid_closest_point(&grid, &query, options, closest);
    CHECK(is_found != all_bytes_are(closest, sizeof *closest, 0xc7));
    return is_found;
}

static hgrid_verdict never(void *context, size_t place, const hgrid_hit *hit)
{
    CHECK(context == NULL && place == 0 && hit == NULL);
    return HGRID_REJECT;
}

static void the_closest_point_is_where_it_says(void)
{
    const float above[3] = {0.4f, 0.3f, 2};
    hgrid_closest closest, other;
    CHECK(find(above, INFINITY, NULL, &closest));
    const uint32_t *corners = mesh_data.indices[closest.primitive];
    float sum = 0;
    for (int axis = 0; axis < 3; axis++) {
        const float a = mesh_data.positions[corners[0]][axis];
        const float b = mesh_data.positions[corners[1]][axis];
        const float c = mesh_data.positions[corners[2]][axis];
        const float there =
            (1 - closest.u - closest.v) * a + closest.u * b + closest.v * c;
        CHECK(fabsf(there - closest.position[axis]) < 1e-6f);
        sum += (above[axis] - closest.position[axis]) * (above[axis] - closest.position[axis]);
    }
    CHECK(fabsf(sum - closest.distance * closest.distance) < 1e-5f);

    /* A point exactly at the limit counts; nothing is nearer. */
    CHECK(find(above, closest.distance, NULL, &other));
    CHECK(memcmp(&closest, &other, sizeof other) == 0);
    CHECK(!find(above, closest.distance * 0.999f, NULL, &other));
    CHECK(!find(above, 0, NULL, &other));

    /* Culling and filters do not apply to closest points. */
    hgrid_counters counters = {0, 0, 0};
    hgrid_query_options options = defaults;
    options.cull = HGRID_CULL_FRONT, options.filter = never, options.counters = &counters;
    CHECK(find(above, INFINITY, &options, &other));
    CHECK(memcmp(&closest, &other, sizeof other) == 0);
    CHECK(counters.primitive_tests > 0 && counters.cell_steps > 0);
    options.skip = closest.primitive;
    CHECK(find(above, INFINITY, &options, &other) && other.primitive != closest.primitive);
    options.mask = 2;
    CHECK(!find(above, INFINITY, &options, &other));

    /* Invalid points and distances. */
    const float odd[][4] = {{NAN, 0, 0, 1},       {0, INFINITY, 0, INFINITY}, {0, 0, -INFINITY, 1},
                            {0.4f, 0.3f, 2, NAN}, {0.4f, 0.3f, 2, -1},        {0, 0, 0, -INFINITY}};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++)
        CHECK(!find(odd[i], odd[i][3], NULL, &other));
    const hgrid_grid nothing = HGRID_GRID_INIT;
    const hgrid_point_query query = anywhere(above);
    CHECK(!hgrid_closest_point(&nothing, &query, NULL, &other));
}

int main(void)
{
    for (int method = 0; method < METHODS; method++) {
        build(method);
        unknown_sides_are_refused();
        sides_are_those_of_the_header();
        masks_are_those_of_the_header();
        a_filter_may_ask_and_say_anything();
        filter_masks_are_those_of_the_header();
        all_hits_are_written_to_their_place();
        the_closest_point_is_where_it_says();
    }
    return 0;
}
