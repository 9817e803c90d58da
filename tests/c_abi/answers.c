/* Answers the queries of the table through the C functions, compiled as C and as C++. */

#include <hgrid.h>

typedef hgrid_grid grid_view;

#include "answers.h"

static hgrid_verdict filter(void *context, size_t ray, const hgrid_hit *hit)
{
    return offer((offers *)context, ray, hit);
}

/* Returns the options of a group, or NULL. */
static const hgrid_query_options *options_of(const asked *how, hgrid_query_options *options)
{
    const hgrid_query_options defaults = HGRID_QUERY_OPTIONS_INIT;
    *options = defaults;
    if (how->of == NULL)
        return NULL;
    options->mask = how->of->mask, options->cull = how->of->cull, options->skip = how->of->skip;
    options->counters = how->counters;
    if (how->of->rule != 0)
        options->filter = filter, options->context = how->seen;
    return options;
}

static void make_views(const hgrid_mesh *mesh, const hgrid_config *config, const void *blob,
                       size_t blob_bytes, grid_view views[VIEWS])
{
    const hgrid_report new_report = HGRID_REPORT_INIT;
    hgrid_report need = new_report, report = new_report;
    uint64_t packed_bytes;
    CHECK(hgrid_sizes(mesh, config, NULL, 0, &need) == HGRID_OK);
    void *scratch = guarded(need.scratch_bytes);
    CHECK(hgrid_sizes(mesh, config, scratch, need.scratch_bytes, &need) == HGRID_OK);
    void *index = guarded(need.index_bytes);
    CHECK(hgrid_build(mesh, config, index, need.index_bytes, scratch, need.scratch_bytes,
                      &views[0], &report) == HGRID_OK);
    CHECK_ANSWER(report.index_bytes == blob_bytes && memcmp(index, blob, blob_bytes) == 0);
    const void *elsewhere = guarded_copy(blob, blob_bytes);
    CHECK(hgrid_open(elsewhere, blob_bytes, mesh, &views[1]) == HGRID_OK);
    CHECK(hgrid_pack(&views[1], NULL, 0, &packed_bytes) == HGRID_ERROR_INDEX_TOO_SMALL);
    void *packed = guarded(packed_bytes);
    CHECK(hgrid_pack(&views[1], packed, packed_bytes, &packed_bytes) == HGRID_OK);
    CHECK(hgrid_open(packed, packed_bytes, NULL, &views[2]) == HGRID_OK);
    for (int i = 0; i < VIEWS; i++)
        CHECK_ANSWER(proof(&views[i]) == HGRID_OK);
}

static bool ask_closest_hit(const grid_view *view, const asked *how, const hgrid_ray *ray,
                            hgrid_hit *hit)
{
    hgrid_query_options options;
    return hgrid_intersect(view, ray, options_of(how, &options), hit);
}

static bool ask_any_hit(const grid_view *view, const asked *how, const hgrid_ray *ray)
{
    hgrid_query_options options;
    return hgrid_occluded(view, ray, options_of(how, &options));
}

static size_t ask_all_hits(const grid_view *view, const asked *how, const hgrid_ray *ray,
                           hgrid_hit *hits, size_t room)
{
    hgrid_query_options options;
    size_t count;
    CHECK(hgrid_intersect_all(view, ray, options_of(how, &options), hits, room, &count) ==
          HGRID_OK);
    return count;
}

static void ask_closest_hits(const grid_view *view, const asked *how, const hgrid_ray *rays,
                             size_t ray_stride, hgrid_hit *hits, size_t hit_stride, size_t count,
                             hgrid_coherence coherence)
{
    hgrid_query_options options;
    CHECK(hgrid_intersect_n(view, rays, ray_stride, hits, hit_stride, count, coherence,
                            options_of(how, &options)) == HGRID_OK);
}

static void ask_any_hits(const grid_view *view, const asked *how, const hgrid_ray *rays,
                         size_t ray_stride, uint8_t *occluded, size_t stride, size_t count,
                         hgrid_coherence coherence)
{
    hgrid_query_options options;
    CHECK(hgrid_occluded_n(view, rays, ray_stride, occluded, stride, count, coherence,
                           options_of(how, &options)) == HGRID_OK);
}

static bool ask_closest_point(const grid_view *view, const asked *how, const float point[3],
                              float max, hgrid_closest *closest)
{
    hgrid_query_options options;
    const hgrid_point_query query = {{point[0], point[1], point[2]}, max};
    return hgrid_closest_point(view, &query, options_of(how, &options), closest);
}

int main(int argc, char **argv)
{
    return check_table(argc, argv);
}
