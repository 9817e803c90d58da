/* The functions of cost.c, through hgrid.hpp. */

#include <hgrid.hpp>

struct pixel {
    hgrid::ray ray;
    hgrid::hit hit;
    std::uint8_t is_dark;
};

extern "C" {

bool nearest(const hgrid::view *grid, const hgrid::ray *ray, float *t)
{
    const auto hit = grid->intersect(*ray);
    if (!hit)
        return false;
    *t = hit->t;
    return true;
}

bool is_dark(const hgrid::view *grid, const hgrid::ray *ray)
{
    return grid->occluded(*ray);
}

hgrid::status trace(const hgrid::view *grid, pixel *pixels, std::size_t count)
{
    const hgrid::span<pixel> tile(pixels, count);
    return grid->intersect_n(hgrid::field(tile, &pixel::ray), hgrid::field(tile, &pixel::hit),
                             hgrid::coherence::coherent);
}

hgrid::status shadow(const hgrid::view *grid, pixel *pixels, std::size_t count)
{
    const hgrid::span<pixel> tile(pixels, count);
    return grid->occluded_n(hgrid::field(tile, &pixel::ray), hgrid::field(tile, &pixel::is_dark),
                            hgrid::coherence::incoherent);
}

bool is_dark_behind_leaves(const hgrid::view *grid, const hgrid::ray *ray,
                           const unsigned char *materials)
{
    auto is_solid = [=](const hgrid::hit &hit) { return materials[hit.primitive] != 0; };
    return grid->occluded(*ray, hgrid::options().cull(hgrid::culling::back).filter(is_solid));
}

float distance(const hgrid::view *grid, const hgrid::point *point, float most)
{
    const auto closest = grid->closest_point(*point, most);
    return closest ? closest->distance : most;
}

std::size_t count_hits(const hgrid::view *grid, const hgrid::ray *ray, hgrid::hit *hits,
                       std::size_t capacity)
{
    const auto count = grid->intersect_all(*ray, {hits, capacity});
    return count ? *count : 0;
}

hgrid::status build(const float (*positions)[3], std::size_t vertex_count,
                    const std::uint32_t (*indices)[3], std::size_t triangle_count, hgrid::byte *index,
                    std::size_t index_bytes, hgrid::byte *scratch, std::size_t scratch_bytes,
                    hgrid::view *grid)
{
    const hgrid::mesh mesh(hgrid::span<const float[3]>(positions, vertex_count),
                           hgrid::span<const std::uint32_t[3]>(indices, triangle_count));
    const auto built = hgrid::view::build(mesh, hgrid::method::bvh, {index, index_bytes},
                                          {scratch, scratch_bytes});
    if (built)
        *grid = *built;
    return built.error();
}
}
