/* Grids in memory of their own and of the caller, and the options of a build. */

#include "hpp.h"

#include <atomic>
#include <memory>
#include <new>
#include <string>
#include <thread>

using hgrid::status;

/* --- memory that runs out ------------------------------------------------------------------------ */

static long allocations_left = -1, allocations_alive = 0;

static void *take(std::size_t bytes, std::size_t alignment) noexcept
{
    if (allocations_left == 0)
        return nullptr;
    allocations_left -= allocations_left > 0;
    void *memory = aligned_alloc(alignment, (bytes + alignment) / alignment * alignment);
    allocations_alive += memory != nullptr;
    return memory;
}

static void give(void *memory) noexcept
{
    allocations_alive -= memory != nullptr;
    std::free(memory);
}

#if __cplusplus >= 201703L
void *operator new(std::size_t bytes, std::align_val_t alignment, const std::nothrow_t &) noexcept
{
    return take(bytes, static_cast<std::size_t>(alignment));
}

void operator delete(void *memory, std::align_val_t, const std::nothrow_t &) noexcept
{
    give(memory);
}
#else
void *operator new(std::size_t bytes, const std::nothrow_t &) noexcept
{
    return take(bytes, alignof(std::max_align_t));
}

void operator delete(void *memory, const std::nothrow_t &) noexcept
{
    give(memory);
}
#endif

/* --- building ------------------------------------------------------------------------------------ */

static constexpr hgrid::method METHODS[] = {hgrid::method::one_level, hgrid::method::fixed,
                                            hgrid::method::variable, hgrid::method::recursive,
                                            hgrid::method::bvh};

static void check_grids()
{
    const scene s(3);
    for (const hgrid::method method : METHODS) {
        CHECK(hgrid::has_method(method));
        hgrid::report report;
        auto built = hgrid::grid::build(s.mesh(), method, &report);
        CHECK(built && built.error() == status::ok && report.index_bytes == built->blob().size());
        CHECK(built->validate() == status::ok);
        CHECK(reinterpret_cast<std::uintptr_t>(built->blob().data()) % hgrid::alignment == 0);

        /* A moved grid answers from the same memory; the one that it was moved from answers nothing. */
        const auto *bytes = built->blob().data();
        hgrid::grid moved(std::move(*built));
        CHECK(moved.blob().data() == bytes && built->blob().empty());
        CHECK(moved.occluded(down()) && !built->occluded(down()));
        hgrid::grid other;
        CHECK(!other.occluded(down()));
        other = std::move(moved);
        CHECK(other.occluded(down()) && !moved.occluded(down()) && moved.blob().empty());

        /* A view of the grid, and the same blob at another address. */
        const hgrid::view view = other;
        CHECK(view.occluded(down()));
        auto copy = hgrid::memory::allocate(other.blob().size());
        CHECK(copy && copy->size() == other.blob().size());
        std::memcpy(copy->data(), other.blob().data(), copy->size());
        const auto adopted = hgrid::grid::adopt(std::move(*copy), s.mesh());
        CHECK(adopted && adopted->occluded(down()));
        const auto opened = hgrid::view::open(other.blob(), s.mesh());
        CHECK(opened && opened->occluded(down()));
        CHECK(hgrid::view::open(other.blob().subspan(0, 64), s.mesh()).error() != status::ok);
        CHECK(hgrid::view::open(other.blob(), scene(2).mesh()).error() == status::mesh_mismatch);
    }
    CHECK(allocations_alive == 0);
    {
        /* A reference keeps what a temporary result had. */
        STATIC_CHECK(std::is_same<decltype(*hgrid::grid::build(s.mesh())), hgrid::grid>::value);
        const auto &named = *hgrid::grid::build(s.mesh());
        CHECK(allocations_alive > 0 && named.occluded(down()));
    }
    CHECK(allocations_alive == 0);

    /* Errors name the triangle. */
    scene broken(1);
    broken.faces[5].corners[1] = 1000000;
    hgrid::report report;
    const auto refused = hgrid::grid::build(broken.mesh(), {}, &report);
    CHECK(!refused && refused.error() == status::index_out_of_range && report.triangle == 5);
    broken = scene(1);
    broken.vertices[0].position[0] = NAN;
    CHECK(hgrid::grid::build(broken.mesh()));
    CHECK(hgrid::grid::build(broken.mesh(), hgrid::config().strict(true)).error() ==
          status::non_finite);
    CHECK(hgrid::grid::build(broken.mesh(), hgrid::config(hgrid::method::one_level).density(-1)).error() ==
          status::invalid_density);
    CHECK(hgrid::message(status::invalid_density) ==
          std::string(hgrid_status_string(HGRID_ERROR_INVALID_DENSITY)));
}

/* Whichever allocation fails, the result is a status, and no memory leaks. */
static void check_memory_that_runs_out()
{
    const scene s(2);
    for (const hgrid::method method : METHODS) {
        long failures = 0;
        for (;; failures++) {
            allocations_left = failures;
            const auto built = hgrid::grid::build(s.mesh(), method);
            allocations_left = -1;
            if (built) {
                CHECK(built->occluded(down()));
                break;
            }
            CHECK(built.error() == status::out_of_memory && allocations_alive == 0);
        }
        /* At least the allocations of scratch and index. */
        CHECK(failures >= 2);
    }
    CHECK(hgrid::memory::allocate(std::numeric_limits<std::uint64_t>::max()).error() ==
          status::out_of_memory);
    CHECK(allocations_alive == 0);
}

static void check_views()
{
    static constexpr std::size_t triangles = 3 * 8 * 8 * 2;
    alignas(hgrid::alignment) static unsigned char index[hgrid::index_bound(triangles)];
    alignas(hgrid::alignment) static unsigned char scratch[hgrid::scratch_bound(triangles)];
    const scene s(3);
    CHECK(s.faces.size() == triangles);
    const auto built = hgrid::view::build(s.mesh(), {}, hgrid::as_writable_bytes(index),
                                          hgrid::as_writable_bytes(scratch));
    CHECK(built && built->occluded(down()));

    hgrid::report rough, exact;
    CHECK(hgrid::sizes(s.mesh(), {}, rough) == status::ok && !rough.is_exact);
    CHECK(hgrid::sizes(s.mesh(), {}, exact, hgrid::as_writable_bytes(scratch)) == status::ok);
    CHECK(exact.is_exact && exact.index_bytes <= rough.index_bytes);
    const auto bound = hgrid::bound(triangles, {});
    CHECK(bound && bound->index_bytes >= rough.index_bytes);

    /* The size that a failed build asks for is enough, and exact for one-level grids. */
    for (const hgrid::method method : {hgrid::method::bvh, hgrid::method::one_level}) {
        const hgrid::config how(method);
        const auto build = [&](std::size_t bytes, hgrid::report &details) {
            return hgrid::view::build(s.mesh(), how,
                                      hgrid::as_writable_bytes(index).subspan(0, bytes),
                                      hgrid::as_writable_bytes(scratch), &details);
        };
        CHECK(hgrid::sizes(s.mesh(), how, exact, hgrid::as_writable_bytes(scratch)) == status::ok);
        hgrid::report details, again;
        CHECK(build(exact.index_bytes, details));
        CHECK(build(exact.index_bytes - 64, details).error() == status::index_too_small);
        CHECK(method == hgrid::method::bvh ? details.index_bytes >= exact.index_bytes
                                             : details.index_bytes == exact.index_bytes);
        CHECK(build(details.index_bytes, again));
    }
}

static void check_progress_and_threads()
{
    /* Enough triangles for two tasks, and detail in a corner. */
    scene s(4, 70);
    for (vertex &v : s.vertices)
        if (v.position[2] < 2)
            v.position = {0.02f * v.position[0], 0.02f * v.position[1], 0.001f * v.position[2]};
    std::vector<float> steps;
    auto watch = [&](float done) { steps.push_back(done); };
    std::atomic<int> runs{0};
    auto run = [&](std::uint32_t count, hgrid::task each) {
        std::vector<std::thread> threads;
        for (std::uint32_t i = 0; i < count; i++)
            threads.emplace_back([=] { each(i); });
        for (std::thread &thread : threads)
            thread.join();
        runs++;
    };
    for (const hgrid::method method : METHODS) {
        steps.clear();
        hgrid::config config(method);
        const auto plain = hgrid::grid::build(s.mesh(), config);
        config.progress(watch).parallel_for(4, run);
        const auto built = hgrid::grid::build(s.mesh(), config);
        CHECK(plain && built && built->occluded(down()));
        CHECK(built->blob().size() == plain->blob().size());
        CHECK(std::memcmp(built->blob().data(), plain->blob().data(), built->blob().size()) == 0);
        CHECK(!steps.empty() && steps.back() >= 1 && steps.back() <= 1);
        for (std::size_t i = 1; i < steps.size(); i++)
            CHECK(steps[i] > steps[i - 1]);
    }
    CHECK(runs > 0);

    auto cancel = [](float done) { return done < 0.3f; };
    const auto cancelled =
        hgrid::grid::build(s.mesh(), hgrid::config(hgrid::method::variable).progress(cancel));
    CHECK(cancelled.error() == status::cancelled);
    auto lazy = [](std::uint32_t, hgrid::task) {};
    CHECK(hgrid::grid::build(s.mesh(), hgrid::config(hgrid::method::bvh).parallel_for(2, lazy))
              .error() == status::parallel_for);
}

static void check_configs()
{
    scene s(3, 40);
    /* Detail in a corner, so that there are subgrids. */
    for (vertex &v : s.vertices)
        if (v.position[2] < 1)
            v.position = {0.02f * v.position[0], 0.02f * v.position[1], 0};
    const auto bytes = [&](const hgrid::config &config) {
        const auto grid = hgrid::grid::build(s.mesh(), config);
        CHECK(grid && grid->occluded(down()));
        return grid->blob().size();
    };
    using hgrid::config;
    using hgrid::method;
    CHECK(bytes(method::one_level) < bytes(config(method::one_level).density(9)));
    CHECK(bytes(method::fixed) < bytes(config(method::fixed).macrocell_factor(2)));
    CHECK(bytes(method::variable) > bytes(config(method::variable).subdivide_above(9999)));
    CHECK(bytes(method::recursive) > bytes(config(method::recursive).depth(1)));
    CHECK(hgrid::grid::build(s.mesh(), hgrid::config(hgrid::method::recursive).depth(99)).error() ==
          status::invalid_depth);
    CHECK(hgrid::grid::build(s.mesh(), static_cast<hgrid::method>(99)).error() == status::invalid_method);

    /* Fit half the bytes; the fitted configuration keeps the progress callback. */
    const auto plain = hgrid::grid::build(s.mesh(), hgrid::method::fixed);
    auto scratch = hgrid::memory::allocate(1 << 22);
    CHECK(plain && scratch);
    int calls = 0;
    auto watch = [&](float) { calls++; };
    const auto fitted = hgrid::fit(s.mesh(), hgrid::config(hgrid::method::fixed).progress(watch),
                                   plain->blob().size() / 2, *scratch);
    CHECK(fitted);
    calls = 0;
    const auto small = hgrid::grid::build(s.mesh(), *fitted);
    CHECK(small && small->blob().size() <= plain->blob().size() / 2 && calls > 0);
    CHECK(hgrid::fit(s.mesh(), hgrid::method::fixed, 64, *scratch).error() ==
          status::index_too_small);
}

/* --- blobs --------------------------------------------------------------------------------------- */

static void check_blobs()
{
    const scene s(3);
    const auto grid = hgrid::grid::build(s.mesh(), hgrid::method::bvh);
    CHECK(grid);
    const auto info = hgrid::peek(grid->blob());
    CHECK(info && info->method == HGRID_METHOD_BVH && info->triangle_count == s.faces.size());
    CHECK(!info->has_mesh && hgrid::view::open(grid->blob()).error() == status::no_mesh);
    CHECK(hgrid::peek(grid->blob().subspan(0, 8)).error() == status::truncated);

    auto packed = grid->pack();
    CHECK(packed);
    const auto about = hgrid::peek(*packed);
    CHECK(about && about->has_mesh && about->total_bytes == packed->size());
    const auto opened = hgrid::view::open(*packed);
    CHECK(opened && opened->validate() == status::ok);
    CHECK(opened->intersect(down())->primitive == grid->intersect(down())->primitive);
    CHECK(grid->packed_bytes() == packed->size() && hgrid::view().packed_bytes() == 0);
    CHECK(grid->pack(hgrid::span<hgrid::byte>(*packed).subspan(0, 64)) == status::index_too_small);
    CHECK(hgrid::view().pack().error() == status::not_a_grid);
    const auto adopted = hgrid::grid::adopt(std::move(*packed));
    CHECK(adopted && adopted->occluded(down()));

    const auto whole = grid->inspect();
    CHECK(whole && whole->longest_list > 0 && whole->degenerate_count == 0);
}

/* A grid keeps the data that it is given wherever it moves, and releases it in the end. */
struct holder {
    hgrid::grid grid;
    int other = 0;
};

static void check_kept()
{
    const scene s(3);
    std::vector<std::array<std::uint32_t, 3>> corners;
    for (const face &f : s.faces)
        corners.push_back(f.corners);
    const auto expected = hgrid::grid::build(s.mesh());
    const auto *first = s.vertices.data();
    std::vector<vertex> vertices = s.vertices;
    CHECK(vertices.data() != first);
    first = vertices.data();
    auto kept = hgrid::grid::keep(std::move(vertices), std::move(corners));
    CHECK(kept && kept->mesh_of()->c().positions == first);
    std::vector<holder> holders;
    for (int i = 0; i < 9; i++)
        holders.emplace_back();
    holders[3].grid = std::move(*kept);
    holders.resize(100);
    CHECK(holders[3].grid.intersect(down())->primitive == expected->intersect(down())->primitive);
    CHECK(!kept->occluded(down()) && holders[3].grid.validate() == status::ok);

    /* Shared data that a mesh points into, and arrays of other types. */
    auto shared = std::make_shared<const scene>(3);
    const auto describe = [](const std::shared_ptr<const scene> &of) { return of->mesh(); };
    {
        auto owner = hgrid::grid::keep(std::shared_ptr<const scene>(shared), describe,
                                       hgrid::method::one_level);
        CHECK(owner && shared.use_count() == 2 && owner->occluded(down()));
        holders[5].grid = std::move(*owner);
    }
    CHECK(shared.use_count() == 2 && holders[5].grid.occluded(down()));
    holders[5].grid = hgrid::grid();
    CHECK(shared.use_count() == 1);
    const auto triangle = hgrid::grid::keep(std::array<float, 9>{0, 0, 0, 1, 0, 0, 0, 1, 0},
                                            std::array<std::uint16_t, 3>{0, 1, 2});
    CHECK(triangle && triangle->occluded(down(0.2f, 0.3f)) && !triangle->occluded(down(0.9f, 0.9f)));

    /* Data of a refused build is released. */
    const auto bad = [](const std::shared_ptr<const scene> &of) {
        hgrid_mesh raw = of->mesh().c();
        raw.vertex_count = 3;
        return hgrid::mesh(raw);
    };
    hgrid::report report;
    const auto refused = hgrid::grid::keep(std::shared_ptr<const scene>(shared), bad,
                                           hgrid::method::bvh, &report);
    CHECK(refused.error() == status::index_out_of_range && report.triangle == 0);
    CHECK(shared.use_count() == 1);

}

void check_builds()
{
    check_grids();
    check_kept();
    /* Before C++17 the count includes kept data, which is freed by a delete that is not counted. */
    CHECK(allocations_alive >= 0);
#if __cplusplus < 201703L
    allocations_alive = 0;
#endif
    check_memory_that_runs_out();
    check_views();
    check_progress_and_threads();
    check_configs();
    check_blobs();
    CHECK(allocations_alive == 0);
}
