/* The types of hgrid.hpp as a C++ renderer uses them: their properties, spans, and meshes in every form. */

#include "hpp.h"

#if __cplusplus >= 202002L
#include <span>
#endif

STATIC_CHECK(!std::is_copy_constructible<hgrid::grid>::value && !std::is_copy_assignable<hgrid::grid>::value);
STATIC_CHECK(std::is_nothrow_move_constructible<hgrid::grid>::value);
STATIC_CHECK(std::is_nothrow_move_assignable<hgrid::grid>::value);
STATIC_CHECK(std::is_trivially_copyable<hgrid::view>::value && sizeof(hgrid::view) == sizeof(hgrid_grid));
STATIC_CHECK(std::is_trivially_copyable<hgrid::options>::value);
STATIC_CHECK(sizeof(hgrid::options) == sizeof(hgrid_query_options));
STATIC_CHECK(sizeof(hgrid::mesh) == sizeof(hgrid_mesh));
STATIC_CHECK(noexcept(std::declval<const hgrid::view &>().intersect(
    std::declval<const hgrid::ray &>(), std::declval<const hgrid::options &>())));
STATIC_CHECK(noexcept(hgrid::grid::build(std::declval<const hgrid::mesh &>())));
STATIC_CHECK(std::is_convertible<std::vector<hgrid::hit> &, hgrid::span<hgrid::hit>>::value);
STATIC_CHECK(std::is_convertible<const std::vector<hgrid::hit> &, hgrid::span<const hgrid::hit>>::value);
STATIC_CHECK(!std::is_convertible<const std::vector<hgrid::hit> &, hgrid::span<hgrid::hit>>::value);
STATIC_CHECK(!std::is_convertible<std::vector<hgrid::hit>, hgrid::span<hgrid::hit>>::value);
STATIC_CHECK(!std::is_convertible<std::vector<hgrid::ray> &, hgrid::span<hgrid::hit>>::value);
STATIC_CHECK(std::is_convertible<hgrid::span<int>, hgrid::span<const int>>::value);
STATIC_CHECK(!std::is_convertible<hgrid::span<const int>, hgrid::span<int>>::value);
STATIC_CHECK(!std::is_convertible<hgrid::strided<int>, hgrid::span<int>>::value);
STATIC_CHECK(std::is_convertible<hgrid::strided<int>, hgrid::strided<const int>>::value);
STATIC_CHECK(std::is_convertible<std::array<int, 3> &, hgrid::strided<int>>::value);
STATIC_CHECK(hgrid::make_ray({1, 2, 3}, {4, 5, 6}, 7, 8).t_max == 8);
STATIC_CHECK(hgrid::make_ray_f64({1e10 + 1, 2, 3}, {4, 5, 6}, 7, 8).origin[0] == 1e10 + 1);
STATIC_CHECK(hgrid::make_ray_f64({1, 2, 3}, {4, 5, 6}, 7, 8).direction[2] == 6);
STATIC_CHECK(hgrid::make_ray_f64({1, 2, 3}, {4, 5, 6}, 7, 8).t_min == 7);
STATIC_CHECK(hgrid::make_ray_f64({1, 2, 3}, {4, 5, 6}, 7, 8).t_max == 8);
STATIC_CHECK(hgrid::make_ray_f64({1, 2, 3}, {4, 5, 6}).t_max == std::numeric_limits<float>::infinity());

/* --- spans --------------------------------------------------------------------------------------- */

struct outer {
    int before;
    struct {
        char c;
        int value;
    } inner;
};

static void check_spans()
{
    int numbers[] = {1, 2, 3, 4};
    const hgrid::span<int> all(numbers);
    CHECK(all.size() == 4 && !all.empty() && all[3] == 4 && all.subspan(1, 2)[1] == 3);
    int sum = 0;
    for (int number : all)
        sum += number;
    CHECK(sum == 10);
    CHECK(hgrid::span<int>().empty() && hgrid::span<int>().begin() == nullptr);
    CHECK(hgrid::as_bytes(numbers).size() == sizeof numbers);
    hgrid::as_writable_bytes(numbers)[0] = hgrid::byte{7};
    CHECK(numbers[0] != 1);

    std::vector<outer> structs(3);
    for (int i = 0; i < 3; i++)
        structs[static_cast<std::size_t>(i)].inner.value = i;
    using inner = decltype(outer::inner);
    const auto values = hgrid::field(hgrid::field(structs, &outer::inner), &inner::value);
    STATIC_CHECK(std::is_same<decltype(values), const hgrid::strided<int>>::value);
    CHECK(values.size() == 3 && values.stride() == sizeof(outer) && values[2] == 2);
    const auto &constant = structs;
    const auto fixed = hgrid::field(constant, &outer::before);
    STATIC_CHECK(std::is_same<decltype(fixed), const hgrid::strided<const int>>::value);
    const std::vector<outer> none;
    CHECK(hgrid::field(none, &outer::before).first() == nullptr);

#if __cplusplus >= 202002L
    const std::span<int> standard(numbers);
    const hgrid::span<const int> ours(standard);
    const std::span<const int> back(ours);
    CHECK(ours.data() == numbers && back.size() == 4);
#endif
}

/* --- the same mesh in every form ----------------------------------------------------------------- */

struct corners16 {
    char name[3];
    std::uint16_t first, second, third;
};

/* Vertices that begin with three floats, in several ways. */
struct named {
    float x, y, z;
    std::uint32_t color;
};
struct nested {
    named position;
    float *elsewhere;
};
class constructed {
public:
    constructed() noexcept : x(0), y(0), z(0) {}
    explicit constructed(const hgrid::point &p) noexcept : x(p[0]), y(p[1]), z(p[2]) {}
    float x, y, z;
};
/* Any three numbers make one, doubles, too. */
class generous {
public:
    generous() noexcept : x(0), y(0), z(0) {}
    template <class X, class Y, class Z>
    generous(X x_, Y y_, Z z_) noexcept : x(float(x_)), y(float(y_)), z(float(z_)) {}
    float x, y, z;
};

/* Checks that a mesh gives the same hits as the scene's own mesh. */
static void check_mesh(const scene &s, const hgrid::mesh &mesh)
{
    CHECK(mesh.vertex_count() == s.vertices.size() && mesh.triangle_count() == s.faces.size());
    const auto expected = hgrid::grid::build(s.mesh());
    const auto grid = hgrid::grid::build(mesh);
    CHECK(expected && grid);
    for (float x = -0.05f; x < 1.1f; x += 0.07f) {
        const auto a = expected->intersect(down(x)), b = grid->intersect(down(x));
        CHECK(a.has_value() == b.has_value());
        CHECK(!a || (a->primitive == b->primitive && a->u <= b->u && a->u >= b->u));
    }
}

static void check_meshes()
{
    const scene s(2, 3);
    std::vector<float> flat;
    std::vector<std::array<float, 3>> arrays;
    std::vector<double> other(5);
    for (const vertex &v : s.vertices) {
        flat.insert(flat.end(), v.position.begin(), v.position.end());
        arrays.push_back(v.position);
    }
    std::vector<std::uint16_t> flat16;
    std::vector<int> flat32;
    std::vector<std::array<std::uint32_t, 3>> triples;
    std::vector<corners16> structs;
    for (const face &f : s.faces) {
        const auto narrow = [&](std::size_t i) { return static_cast<std::uint16_t>(f.corners[i]); };
        structs.push_back({"ab", narrow(0), narrow(1), narrow(2)});
        triples.push_back(f.corners);
        for (std::size_t i = 0; i < 3; i++) {
            flat16.push_back(narrow(i));
            flat32.push_back(static_cast<int>(f.corners[i]));
        }
    }
    check_mesh(s, {s.vertices, triples});
    check_mesh(s, {flat, flat16});
    check_mesh(s, {arrays, flat32});
    check_mesh(s, {hgrid::field(s.vertices, &vertex::position), triples});
    check_mesh(s, {hgrid::span<const float>(flat), hgrid::field(structs, &corners16::first)});
    check_mesh(s, hgrid::mesh(s.mesh().c()));
    /* Four numbers for each vertex and for each triangle, of which the last one is padding. */
    std::vector<std::array<float, 4>> wide;
    for (const vertex &v : s.vertices)
        wide.push_back({{v.position[0], v.position[1], v.position[2], NAN}});
    std::vector<std::array<std::uint32_t, 4>> padded;
    for (const face &f : s.faces)
        padded.push_back({{f.corners[0], f.corners[1], f.corners[2], 12345678}});
    const hgrid::strided<const std::uint32_t> corners(padded[0].data(), sizeof padded[0], padded.size());
    check_mesh(s, {wide, corners});
    std::vector<named> by_name;
    std::vector<nested> in_structs;
    std::vector<constructed> of_classes;
    std::vector<generous> of_any;
    for (const hgrid::point &p : arrays) {
        by_name.push_back({p[0], p[1], p[2], 0});
        in_structs.push_back({by_name.back(), nullptr});
        of_classes.emplace_back(p);
        of_any.emplace_back(p[0], p[1], p[2]);
    }
    check_mesh(s, {by_name, triples});
    check_mesh(s, {in_structs, triples});
    check_mesh(s, {of_classes, triples});
    check_mesh(s, {of_any, triples});
#if __cplusplus >= 202002L
    check_mesh(s, {std::span(arrays), std::span(flat16)});
#endif
}

/* A report that was not told how it begins is one that C takes. */
static void check_reports()
{
    CHECK(hgrid::report().struct_size == sizeof(hgrid_report));
    const ::hgrid_refit_report usual = HGRID_REFIT_REPORT_INIT;
    for (const hgrid::refit_report &report : {hgrid::refit_report(), hgrid::refit_report(usual)})
        CHECK(report.struct_size == sizeof usual && report.triangle == hgrid::invalid_id);
}

void check_types()
{
    check_spans();
    check_meshes();
    check_reports();
}

int main()
{
    CHECK(hgrid::is_compatible());
    check_types();
    check_builds();
    check_queries();
    check_scenes();
    std::puts("all is well");
}
