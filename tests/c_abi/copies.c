/* A program with two copies of the library, one of them under names that start with other_: a grid of one
 * copy answers in the other. */

#include "check.h"

hgrid_status other_hgrid_build(const hgrid_mesh *mesh, const hgrid_config *config, void *index,
                               size_t index_bytes, void *scratch, size_t scratch_bytes,
                               hgrid_grid *grid, hgrid_report *report);

hgrid_status other_hgrid_intersect_n(const hgrid_grid *grid, const hgrid_ray *rays,
                                     size_t ray_stride, hgrid_hit *hits, size_t hit_stride,
                                     size_t count, hgrid_coherence coherence,
                                     const hgrid_query_options *options);

int main(void)
{
    static sheet data;
    make_sheet(&data);
    const hgrid_mesh mesh = mesh_of(&data);
    const hgrid_config config = HGRID_CONFIG_INIT;
    const hgrid_report need = exact_sizes(&mesh, &config);
    void *scratch = guarded(need.scratch_bytes);
    void *index[2] = {guarded(need.index_bytes), guarded(need.index_bytes)};
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid[2];
    CHECK(hgrid_build(&mesh, &config, index[0], need.index_bytes, scratch, need.scratch_bytes,
                      &grid[0], NULL) == HGRID_OK);
    CHECK(other_hgrid_build(&mesh, &config, index[1], need.index_bytes, scratch, need.scratch_bytes,
                            &grid[1], &report) == HGRID_OK);
    CHECK(memcmp(index[0], index[1], report.index_bytes) == 0);

    enum { RAYS = 100 };
    hgrid_ray rays[RAYS];
    hgrid_hit hits[2][RAYS];
    for (int i = 0; i < RAYS; i++)
        rays[i] = ray_down((float)(i % 10) / 9, (float)(i / 10) / 9);
    CHECK(hgrid_intersect_n(&grid[1], rays, 0, hits[0], 0, RAYS, HGRID_COHERENCE_COHERENT, NULL) ==
          HGRID_OK);
    CHECK(other_hgrid_intersect_n(&grid[0], rays, 0, hits[1], 0, RAYS, HGRID_COHERENCE_INCOHERENT,
                                  NULL) == HGRID_OK);
    CHECK(memcmp(hits[0], hits[1], sizeof hits[0]) == 0);
    CHECK(hits[0][55].primitive != HGRID_INVALID_ID);
    return 0;
}
