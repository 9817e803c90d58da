/*
 * hgrid from C++ (14 or later), without exceptions and without a pointer: a table under a leaf with holes.
 *
 *     cargo build --release -p hgrid-capi
 *     c++ -std=c++17 -Iinclude c_examples/hello.cpp target/release/libhgrid.a -o hello
 */

#include <hgrid.hpp>

#include <cstdio>
#include <vector>

namespace {

/* Your structs: hgrid reads positions and indices where they are. */
struct vertex {
    float x, y, z;
    unsigned char colour[4];
};

struct triangle {
    std::uint16_t corners[3];
    std::uint16_t material;
};

enum : std::uint16_t { WOOD, LEAF };

/* A pixel with its ray and its hit in one struct. */
struct pixel {
    hgrid::ray ray;
    hgrid::hit hit;
};

} // namespace

int main()
{
    /* A table of two triangles at y = 0, and a leaf of one at y = 1. */
    const std::vector<vertex> vertices = {
        {0, 0, 0, {}}, {4, 0, 0, {}}, {4, 0, 4, {}}, {0, 0, 4, {}},
        {0, 1, 0, {}}, {4, 1, 0, {}}, {0, 1, 4, {}},
    };
    const std::vector<triangle> triangles = {
        {{0, 1, 2}, WOOD}, {{0, 2, 3}, WOOD}, {{4, 5, 6}, LEAF},
    };

    /* Build. The grid frees its memory in its destructor. */
    const hgrid::mesh mesh(vertices, hgrid::field(triangles, &triangle::corners));
    const auto grid = hgrid::grid::build(mesh, hgrid::method::bvh);
    if (!grid)
        return std::fprintf(stderr, "%s\n", hgrid::message(grid.error())), 1;

    /* One ray, straight down. */
    const auto ray = hgrid::make_ray({1, 3, 1}, {0, -1, 0});
    if (const auto hit = grid->intersect(ray))
        std::printf("triangle %u at t = %g\n", static_cast<unsigned>(hit->primitive),
                    static_cast<double>(hit->t));

    /* The leaf has a hole where both weights are below 0.3: a ray passes through it. */
    auto is_solid = [&](const hgrid::hit &hit) {
        return triangles[hit.primitive].material != LEAF || hit.u > 0.3f || hit.v > 0.3f;
    };
    hgrid::options options;
    options.filter(is_solid);
    if (const auto hit = grid->intersect(ray, options))
        std::printf("through the hole: triangle %u at t = %g\n",
                    static_cast<unsigned>(hit->primitive), static_cast<double>(hit->t));

    /* Many rays with one call, from and into your structs. */
    std::vector<pixel> pixels(12 * 24);
    for (std::size_t i = 0; i < pixels.size(); i++) {
        const float x = static_cast<float>(i % 24) / 5 - 0.3f;
        const float z = static_cast<float>(i / 24) / 2.5f - 0.2f;
        pixels[i].ray = hgrid::make_ray({x, 3, z}, {0, -1, 0});
    }
    const auto status =
        grid->intersect_n(hgrid::field(pixels, &pixel::ray), hgrid::field(pixels, &pixel::hit),
                          hgrid::coherence::coherent, options);
    if (status != hgrid::status::ok)
        return std::fprintf(stderr, "%s\n", hgrid::message(status)), 1;
    for (std::size_t i = 0; i < pixels.size(); i++) {
        const auto id = pixels[i].hit.primitive;
        const char *letter = id == hgrid::invalid_id ? "." : triangles[id].material == LEAF ? "#" : "_";
        std::printf("%s%s", letter, i % 24 == 23 ? "\n" : "");
    }
}
