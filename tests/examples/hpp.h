/* Helpers of the programs about hgrid.hpp. */
#ifndef HPP_H
#define HPP_H

#include <hgrid.hpp>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <type_traits>
#include <vector>

#define CHECK(condition)                                                                  \
    do {                                                                                  \
        if (!(condition)) {                                                               \
            std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);          \
            std::exit(1);                                                                 \
        }                                                                                 \
    } while (false)

/* A check at compile time. */
#define STATIC_CHECK(...) static_assert((__VA_ARGS__), #__VA_ARGS__)

/* Each file checks a part; the first check that fails ends the program. */
void check_types();
void check_builds();
void check_queries();
void check_scenes();

struct vertex {
    hgrid::point position;
    float s, t;
};

struct face {
    std::int64_t material;
    std::array<std::uint32_t, 3> corners;
};

/* Square sheets over the unit square at z = 0, 1, 2, ..., facing up. */
struct scene {
    std::vector<vertex> vertices;
    std::vector<face> faces;

    explicit scene(int sheets, int cells = 8)
    {
        for (int z = 0; z < sheets; z++) {
            const auto first = static_cast<std::uint32_t>(vertices.size());
            const auto row = static_cast<std::uint32_t>(cells + 1);
            for (int y = 0; y <= cells; y++)
                for (int x = 0; x <= cells; x++)
                    vertices.push_back({{static_cast<float>(x) / static_cast<float>(cells),
                                         static_cast<float>(y) / static_cast<float>(cells),
                                         static_cast<float>(z)},
                                        0,
                                        0});
            for (std::uint32_t y = 0; y + 1 < row; y++)
                for (std::uint32_t x = 0; x + 1 < row; x++) {
                    const auto a = first + y * row + x, b = a + 1, c = b + row, d = a + row;
                    faces.push_back({z, {a, b, c}});
                    faces.push_back({z, {a, c, d}});
                }
        }
    }

    hgrid::mesh mesh() const { return {vertices, hgrid::field(faces, &face::corners)}; }
};

/* Returns a ray straight down, at a point that lies on no edge. */
inline hgrid::ray down(float x = 0.31f, float y = 0.57f)
{
    return hgrid::make_ray({x, y, 100}, {0, 0, -1});
}

inline bool is_near(float a, float b)
{
    return std::fabs(a - b) < 1e-4f;
}

#endif
