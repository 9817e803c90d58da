/* Queries answer, however the grid is held. */

#include "check.h"

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

static sheet mesh_data;
static hgrid_grid grid;
static hgrid_report built;
static void *blob;

static void build(void)
{
    make_sheet(&mesh_data);
    const hgrid_mesh mesh = mesh_of(&mesh_data);
    const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;
    const hgrid_report need = exact_sizes(&mesh, &one_level);
    blob = guarded(need.index_bytes);
    void *scratch = guarded(need.scratch_bytes);
    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &one_level, blob, need.index_bytes, scratch,
                                 need.scratch_bytes, &grid, &report));
    CHECK(report.index_bytes == need.index_bytes && report.is_exact == 1);
    CHECK(report.scratch_bytes == need.scratch_bytes);
    CHECK(report.triangle == HGRID_INVALID_ID && report.skipped_count == 0);
    CHECK(report.density == 4 && report.reference_count >= TRIANGLES);
    CHECK(report.resolution[0] > 5 && report.resolution[1] > 5 && report.resolution[2] > 0);
    EXPECT_PROOF(HGRID_OK, &grid);
    built = report;
}

/* Checks that a hit's position is the same on its triangle and on its ray. */
static void check_hit(const hgrid_ray *ray, const hgrid_hit *hit)
{
    CHECK(hit->primitive < TRIANGLES);
    const uint32_t *corners = mesh_data.indices[hit->primitive];
    for (int axis = 0; axis < 3; axis++) {
        const float a = mesh_data.positions[corners[0]][axis];
        const float b = mesh_data.positions[corners[1]][axis];
        const float c = mesh_data.positions[corners[2]][axis];
        const float on_triangle = (1 - hit->u - hit->v) * a + hit->u * b + hit->v * c;
        const float on_ray = ray->origin[axis] + hit->t * ray->direction[axis];
        CHECK(fabsf(on_triangle - on_ray) < 1e-5f);
    }
}

/* Checks that answers are those of the first grid, bit by bit. */
static void check_same(const hgrid_grid *other)
{
    for (int y = 0; y < 40; y++)
        for (int x = 0; x < 40; x++) {
            const hgrid_ray ray = ray_down((float)x / 36 - 0.02f, (float)y / 36 - 0.02f);
            hgrid_hit expected, found;
            memset(&expected, 0xc7, sizeof expected);
            memset(&found, 0xc7, sizeof found);
            const bool is_hit = hgrid_intersect(&grid, &ray, NULL, &expected);
            CHECK(hgrid_intersect(other, &ray, NULL, &found) == is_hit);
            CHECK(memcmp(&expected, &found, sizeof found) == 0);
            CHECK(hgrid_occluded(other, &ray, NULL) == is_hit);
            CHECK(is_hit || all_bytes_are(&found, sizeof found, 0xc7));
        }
}

static void every_triangle_is_hit_in_its_middle(void)
{
    for (uint32_t id = 0; id < TRIANGLES; id++) {
        const uint32_t *corners = mesh_data.indices[id];
        float x = 0, y = 0;
        for (int i = 0; i < 3; i++) {
            x += mesh_data.positions[corners[i]][0] / 3;
            y += mesh_data.positions[corners[i]][1] / 3;
        }
        const hgrid_ray ray = ray_down(x, y);
        hgrid_hit hit;
        CHECK(hgrid_intersect(&grid, &ray, NULL, &hit));
        CHECK(hit.primitive == id);
        check_hit(&ray, &hit);
    }
}

/* Returns the float that comes `floats` after a positive one. */
static float next(float x, int floats)
{
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits += floats;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* The exact t lies on one side of the rounded one, and no farther than the next float. */
static void the_range_of_a_ray_is_decided_by_the_exact_t(void)
{
    hgrid_ray ray = ray_down(0.4f, 0.3f);
    hgrid_hit hit, again;
    CHECK(hgrid_intersect(&grid, &ray, NULL, &hit));
    ray.t_min = next(hit.t, -1);
    ray.t_max = next(hit.t, 1);
    CHECK(hgrid_intersect(&grid, &ray, NULL, &again) && again.t == hit.t);
    CHECK(hgrid_occluded(&grid, &ray, NULL));
    ray.t_max = hit.t;
    const bool is_before = hgrid_intersect(&grid, &ray, NULL, &again);
    ray.t_min = hit.t;
    ray.t_max = next(hit.t, 1);
    const bool is_behind = hgrid_intersect(&grid, &ray, NULL, &again);
    CHECK(is_before || is_behind);
    ray.t_min = 0;
    ray.t_max = next(hit.t, -1);
    CHECK(!hgrid_intersect(&grid, &ray, NULL, &again) && !hgrid_occluded(&grid, &ray, NULL));
    ray.t_min = next(hit.t, 1);
    ray.t_max = FLT_MAX;
    CHECK(!hgrid_intersect(&grid, &ray, NULL, &again) && !hgrid_occluded(&grid, &ray, NULL));
}

static void odd_rays_miss(void)
{
    for (int i = 0; i < 5; i++) {
        hgrid_ray ray = ray_down(0.5f, 0.5f);
        hgrid_hit hit;
        CHECK(hgrid_intersect(&grid, &ray, NULL, &hit));
        memset(&hit, 0xc7, sizeof hit);
        switch (i) {
        case 0: ray.origin[0] = NAN; break;
        case 1: ray.direction[2] = 0; break;
        case 2: ray.direction[1] = INFINITY; break;
        case 3: ray.t_max = NAN; break;
        case 4: ray.t_min = 1, ray.t_max = 0; break;
        }
        CHECK(!hgrid_intersect(&grid, &ray, NULL, &hit) && !hgrid_occluded(&grid, &ray, NULL));
        CHECK(all_bytes_are(&hit, sizeof hit, 0xc7));
    }
}

static void a_view_is_a_value(void)
{
    hgrid_grid copy = grid, *moved = (hgrid_grid *)guarded(sizeof *moved);
    check_same(&copy);
    memcpy(moved, &copy, sizeof copy);
    memset(&copy, 0, sizeof copy);
    check_same(moved);
    EXPECT_PROOF(HGRID_OK, moved);
}

static void a_blob_opens_elsewhere(void)
{
    const void *elsewhere = guarded_copy(blob, built.index_bytes);
    const sheet *mesh_elsewhere = (const sheet *)guarded_copy(&mesh_data, sizeof mesh_data);
    const hgrid_mesh mesh = mesh_of(mesh_elsewhere);
    hgrid_grid opened;
    EXPECT(HGRID_OK, hgrid_open(elsewhere, built.index_bytes, &mesh, &opened));
    EXPECT_PROOF(HGRID_OK, &opened);
    check_same(&opened);

    /* Bytes after the blob are ignored. */
    unsigned char *longer = (unsigned char *)guarded(built.index_bytes + 64);
    memcpy(longer, blob, built.index_bytes);
    EXPECT(HGRID_OK, hgrid_open(longer, built.index_bytes + 64, &mesh, &opened));
    check_same(&opened);
}

static void an_empty_view_hits_nothing(void)
{
    hgrid_grid empty;
    memset(&empty, 0, sizeof empty);
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    hgrid_hit hit;
    CHECK(!hgrid_intersect(&empty, &ray, NULL, &hit) && !hgrid_occluded(&empty, &ray, NULL));
    EXPECT_PROOF(HGRID_ERROR_NOT_A_GRID, &empty);
}

static void counters_add_up(void)
{
    hgrid_counters once = {0, 0, 0}, twice = {0, 0, 0};
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_ray ray = ray_down(0.5f, 0.5f), beside = ray_down(5, 5);
    hgrid_hit plain, counted;

    CHECK(hgrid_intersect(&grid, &ray, &options, &plain));
    options.counters = &once;
    CHECK(hgrid_intersect(&grid, &ray, &options, &counted));
    CHECK(memcmp(&plain, &counted, sizeof plain) == 0);
    CHECK(once.primitive_tests > 0 && once.cell_steps > 0 && once.grid_steps == 0);

    options.counters = &twice;
    CHECK(hgrid_intersect(&grid, &ray, &options, &counted));
    CHECK(hgrid_intersect(&grid, &ray, &options, &counted));
    CHECK(!hgrid_intersect(&grid, &beside, &options, &counted));
    CHECK(twice.primitive_tests == 2 * once.primitive_tests);
    CHECK(twice.cell_steps == 2 * once.cell_steps);

    options.counters = &once;
    CHECK(hgrid_occluded(&grid, &ray, &options));
    CHECK(once.cell_steps * 2 > twice.cell_steps);
}

static void the_lowest_of_equal_triangles_wins(void)
{
    static const float positions[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static const uint32_t indices[3][3] = {{0, 1, 2}, {2, 0, 1}, {1, 2, 0}};
    HGRID_ALIGNED static unsigned char index[HGRID_INDEX_BOUND(3)];
    HGRID_ALIGNED static unsigned char scratch[HGRID_SCRATCH_BOUND(3)];
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = positions, mesh.vertex_count = 3;
    mesh.indices = indices, mesh.triangle_count = 3;
    hgrid_grid equal;
    EXPECT(HGRID_OK, hgrid_build(&mesh, NULL, index, sizeof index, scratch, sizeof scratch, &equal,
                                 NULL));
    const hgrid_ray ray = ray_down(0.25f, 0.5f);
    hgrid_hit hit;
    CHECK(hgrid_intersect(&equal, &ray, NULL, &hit));
    CHECK(hit.primitive == 0 && hit.t == 1 && hit.u == 0.25f && hit.v == 0.5f);
}

/* Rays that start at a hit, above or below the surface, do not hit the triangle where they start. */
static void rays_leave_the_surface_where_they_start(void)
{
    size_t found = 0;
    for (int y = 1; y < 40; y++)
        for (int x = 1; x < 40; x++) {
            const hgrid_ray ray = ray_down((float)x / 39.7f, (float)y / 39.3f);
            hgrid_hit hit, other;
            hgrid_surface at;
            memset(&at, 0xc7, sizeof at);
            if (!hgrid_intersect(&grid, &ray, NULL, &hit))
                continue;
            CHECK(hgrid_surface_at(&grid, &ray, &hit, &at));
            float length = 0, along = 0;
            for (int axis = 0; axis < 3; axis++) {
                const float there = ray.origin[axis] + hit.t * ray.direction[axis];
                CHECK(fabsf(at.position[axis] - there) < 1e-5f);
                CHECK(fabsf(at.above[axis] - there) < 2e-5f);
                CHECK(fabsf(at.below[axis] - there) < 2e-5f);
                length += at.normal[axis] * at.normal[axis];
                along += at.normal[axis] * ray.direction[axis];
            }
            CHECK(fabsf(length - 1) < 1e-6f && along < 0);
            hgrid_query_options front = HGRID_QUERY_OPTIONS_INIT;
            front.cull = at.is_front ? HGRID_CULL_BACK : HGRID_CULL_FRONT;
            CHECK(hgrid_intersect(&grid, &ray, &front, &other) && other.primitive == hit.primitive);

            const hgrid_ray up = {{at.above[0], at.above[1], at.above[2]}, 0,
                                  {at.normal[0], at.normal[1], at.normal[2]}, INFINITY};
            CHECK(!hgrid_intersect(&grid, &up, NULL, &other) || other.primitive != hit.primitive);
            const hgrid_ray on = {{at.below[0], at.below[1], at.below[2]}, 0,
                                  {ray.direction[0], ray.direction[1], ray.direction[2]}, INFINITY};
            CHECK(!hgrid_intersect(&grid, &on, NULL, &other) || other.primitive != hit.primitive);
            hit.primitive = found % 2 == 0 ? (uint32_t)TRIANGLES : HGRID_INVALID_ID;
            memset(&at, 0xc7, sizeof at);
            CHECK(!hgrid_surface_at(&grid, &ray, &hit, &at));
            CHECK(all_bytes_are(&at, sizeof at, 0xc7));
            found++;
        }
    CHECK(found > 500);
}

/* Programs that flush denormal numbers to zero, as renderers do, get the same grids and the same hits. */
static void denormal_numbers_may_be_zero(void)
{
#if defined(__SSE__)
    const unsigned before = _mm_getcsr();
    const hgrid_mesh mesh = mesh_of(&mesh_data);
    for (int method = 0; method <= METHODS; method++) {
        /* After the usual methods comes a tree of high quality. */
        hgrid_config config = usual(method < METHODS ? method : METHODS - 1);
        if (method == METHODS)
            config.quality = HGRID_QUALITY_HIGH;
        void *plain_blob, *other_blob;
        size_t plain_bytes, bytes;
        build_exactly(&mesh, &config, &plain_blob, &plain_bytes);
        for (unsigned bits = 0x0040; bits <= 0x8040; bits += 0x8000) {
            _mm_setcsr(before | bits);
            const hgrid_grid other = build_exactly(&mesh, &config, &other_blob, &bytes);
            CHECK(bytes == plain_bytes && memcmp(other_blob, plain_blob, bytes) == 0);
            EXPECT_PROOF(HGRID_OK, &other);
            check_same(&other);
            _mm_setcsr(before);
        }
    }
#endif
}

int main(void)
{
    build();
    rays_leave_the_surface_where_they_start();
    denormal_numbers_may_be_zero();
    every_triangle_is_hit_in_its_middle();
    the_range_of_a_ray_is_decided_by_the_exact_t();
    odd_rays_miss();
    a_view_is_a_value();
    a_blob_opens_elsewhere();
    an_empty_view_hits_nothing();
    counters_add_up();
    the_lowest_of_equal_triangles_wins();
    return 0;
}
