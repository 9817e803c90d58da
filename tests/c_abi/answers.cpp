// Answers the queries of the table through hgrid.hpp.

#include <hgrid.hpp>

#include <vector>

using grid_view = hgrid::view;

#include "answers.h"

namespace {

// The options of a group, with the filter that they refer to.
class told {
public:
    explicit told(const asked &how) : filter_{how.seen}
    {
        options_.mask(how.of->mask).cull(static_cast<hgrid::culling>(how.of->cull)).skip(how.of->skip);
        if (how.counters != nullptr)
            options_.count(*how.counters);
        if (how.of->rule != 0)
            options_.filter(filter_);
    }
    const hgrid::options &options() const { return options_; }

private:
    struct filter {
        offers *seen;
        hgrid::verdict operator()(std::size_t place, const hgrid::hit &hit) const
        {
            return static_cast<hgrid::verdict>(offer(seen, place, &hit));
        }
    };
    filter filter_;
    hgrid::options options_;
};

// Owners of the grids and blobs that the views refer to.
std::vector<hgrid::grid> grids;
std::vector<hgrid::memory> blobs;

hgrid::config config_of(const hgrid_config &c)
{
    hgrid::config config(static_cast<hgrid::method>(c.method));
    return config.density(c.density)
        .quality(static_cast<hgrid::quality>(c.quality))
        .macrocell_factor(c.macrocell_factor)
        .subdivide_above(c.subdivide_above)
        .depth(c.depth)
        .strict(c.flags == HGRID_BUILD_STRICT);
}

// Makes the mesh from spans where its arrays are contiguous.
hgrid::mesh mesh_from(const hgrid_mesh &m)
{
    if (m.position_stride != 0)
        return hgrid::mesh(m);
    using corners = std::array<std::uint32_t, 3>;
    const hgrid::span<const hgrid::point> vertices(static_cast<const hgrid::point *>(m.positions),
                                                   m.vertex_count);
    const hgrid::span<const corners> triangles(static_cast<const corners *>(m.indices),
                                               m.triangle_count);
    hgrid::mesh mesh(vertices, triangles);
    if (m.masks != nullptr)
        mesh.masks({static_cast<const std::uint32_t *>(m.masks), 4, m.triangle_count});
    return mesh;
}

} // namespace

static void make_views(const hgrid_mesh *raw, const hgrid_config *config, const void *blob,
                       size_t blob_bytes, grid_view views[VIEWS])
{
    const hgrid::mesh mesh = mesh_from(*raw);
    auto built = hgrid::grid::build(mesh, config_of(*config));
    CHECK(built.has_value() && built->blob().size() == blob_bytes);
    CHECK_ANSWER(std::memcmp(built->blob().data(), blob, blob_bytes) == 0);
    auto elsewhere = hgrid::memory::allocate(blob_bytes);
    CHECK(elsewhere.has_value());
    std::memcpy(elsewhere->data(), blob, blob_bytes);
    const auto opened = hgrid::view::open(*elsewhere, mesh);
    CHECK(opened.has_value());
    auto packed = opened->pack();
    CHECK(packed.has_value());
    const auto own = hgrid::view::open(*packed);
    CHECK(own.has_value());
    views[0] = *built, views[1] = *opened, views[2] = *own;
    for (int i = 0; i < VIEWS; i++)
        CHECK_ANSWER(views[i].validate() == hgrid::status::ok);
    grids.push_back(std::move(*built));
    blobs.push_back(std::move(*elsewhere));
    blobs.push_back(std::move(*packed));
}

static bool ask_closest_hit(const grid_view *view, const asked *how, const hgrid_ray *ray,
                            hgrid_hit *hit)
{
    const auto found = how->of == nullptr ? view->intersect(*ray)
                                          : view->intersect(*ray, told(*how).options());
    if (found)
        *hit = *found;
    return found.has_value();
}

static bool ask_any_hit(const grid_view *view, const asked *how, const hgrid_ray *ray)
{
    return how->of == nullptr ? view->occluded(*ray) : view->occluded(*ray, told(*how).options());
}

static size_t ask_all_hits(const grid_view *view, const asked *how, const hgrid_ray *ray,
                           hgrid_hit *hits, size_t room)
{
    const hgrid::span<hgrid_hit> to(hits, room);
    const auto count = how->of == nullptr ? view->intersect_all(*ray, to)
                                          : view->intersect_all(*ray, to, told(*how).options());
    CHECK(count.has_value());
    return *count;
}

static void ask_closest_hits(const grid_view *view, const asked *how, const hgrid_ray *rays,
                             size_t ray_stride, hgrid_hit *hits, size_t hit_stride, size_t count,
                             hgrid_coherence coherence)
{
    const hgrid::strided<const hgrid_ray> from(rays, ray_stride, count);
    const hgrid::strided<hgrid_hit> to(hits, hit_stride, count);
    const auto known = static_cast<hgrid::coherence>(coherence);
    const auto status = how->of == nullptr
                            ? view->intersect_n(from, to, known)
                            : view->intersect_n(from, to, known, told(*how).options());
    CHECK(status == hgrid::status::ok);
}

static void ask_any_hits(const grid_view *view, const asked *how, const hgrid_ray *rays,
                         size_t ray_stride, uint8_t *occluded, size_t stride, size_t count,
                         hgrid_coherence coherence)
{
    const hgrid::strided<const hgrid_ray> from(rays, ray_stride, count);
    const hgrid::strided<std::uint8_t> to(occluded, stride, count);
    const auto known = static_cast<hgrid::coherence>(coherence);
    const auto status = how->of == nullptr
                            ? view->occluded_n(from, to, known)
                            : view->occluded_n(from, to, known, told(*how).options());
    CHECK(status == hgrid::status::ok);
}

static bool ask_closest_point(const grid_view *view, const asked *how, const float point[3],
                              float max, hgrid_closest *closest)
{
    const hgrid::point from = {point[0], point[1], point[2]};
    const auto found = view->closest_point(from, max, told(*how).options());
    if (found)
        *closest = *found;
    return found.has_value();
}

int main(int argc, char **argv)
{
    return check_table(argc, argv);
}
