/* Builds the mesh and asks the rays that come in, and sends out the blob and the answers: the test
 * compares them with what core says in Rust.
 *
 *   in   the configuration; counts of vertices, triangles and rays; positions; indices; rays
 *   out  bytes of the blob; the blob; for each ray a hit (zero if none) and whether it is occluded;
 *        the counters of all closest-hit queries; for each coherence the hits of all rays in one
 *        batch, and a byte for each that says whether it is occluded
 */

#include "check.h"

static void receive(void *to, size_t bytes)
{
    CHECK(fread(to, 1, bytes, stdin) == bytes);
}

static void *receive_array(size_t bytes)
{
    void *array = guarded(bytes);
    receive(array, bytes);
    return array;
}

static void send(const void *from, size_t bytes)
{
    CHECK(fwrite(from, 1, bytes, stdout) == bytes);
}

int main(void)
{
    hgrid_config config = HGRID_CONFIG_INIT;
    uint32_t counts[3];
    receive(&config.method, offsetof(hgrid_config, tasks) - offsetof(hgrid_config, method));
    receive(counts, sizeof counts);
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.vertex_count = counts[0];
    mesh.positions = receive_array(12 * mesh.vertex_count);
    mesh.triangle_count = counts[1];
    mesh.indices = receive_array(12 * mesh.triangle_count);

    hgrid_report need = HGRID_REPORT_INIT, report = HGRID_REPORT_INIT;
    CHECK(hgrid_sizes(&mesh, &config, NULL, 0, &need) == HGRID_OK);
    void *scratch = guarded(need.scratch_bytes);
    CHECK(hgrid_sizes(&mesh, &config, scratch, need.scratch_bytes, &need) == HGRID_OK);
    if (config.method == HGRID_METHOD_ONE_LEVEL && config.density == 4) {
        /* The bounds are enough for any mesh. */
        CHECK(need.index_bytes <= HGRID_INDEX_BOUND(counts[1]) / 64 * 64);
        CHECK(need.scratch_bytes <= HGRID_SCRATCH_BOUND(counts[1]) / 64 * 64);
    }
    void *index = guarded(need.index_bytes);
    hgrid_grid grid;
    CHECK(hgrid_build(&mesh, &config, index, need.index_bytes, scratch, need.scratch_bytes, &grid,
                      &report) == HGRID_OK);
    send(&report.index_bytes, sizeof report.index_bytes);
    send(index, (size_t)report.index_bytes);

    hgrid_counters counters = {0, 0, 0};
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    options.counters = &counters;
    const size_t count = counts[2];
    const hgrid_ray *rays = (const hgrid_ray *)receive_array(count * sizeof *rays);
    for (size_t i = 0; i < count; i++) {
        hgrid_hit hit = {0, 0, 0, 0};
        const bool is_hit = hgrid_intersect(&grid, &rays[i], &options, &hit);
        const uint32_t answers[2] = {is_hit, hgrid_occluded(&grid, &rays[i], NULL)};
        send(&hit, sizeof hit);
        send(answers, sizeof answers);
    }
    send(&counters, sizeof counters);

    hgrid_hit *hits = (hgrid_hit *)guarded(count * sizeof *hits);
    uint8_t *occluded = (uint8_t *)guarded(count);
    const hgrid_coherence all[] = {HGRID_COHERENCE_INCOHERENT, HGRID_COHERENCE_COHERENT};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        CHECK(hgrid_intersect_n(&grid, rays, 0, hits, 0, count, all[i], NULL) == HGRID_OK);
        CHECK(hgrid_occluded_n(&grid, rays, 0, occluded, 0, count, all[i], NULL) == HGRID_OK);
        send(hits, count * sizeof *hits);
        send(occluded, count);
    }
    return 0;
}
