/* Single rays and batches, with every option of a query. */

#include "hpp.h"

using hgrid::status;

struct pixel {
    char name;
    hgrid::ray ray;
    hgrid::hit hit;
    std::uint8_t is_dark;
    std::uint32_t blocker;
};

static void check_rays()
{
    const scene s(5);
    const auto grid = hgrid::grid::build(s.mesh());
    CHECK(grid);
    const auto top = grid->intersect(down());
    CHECK(top && is_near(top->t, 96) && s.faces[top->primitive].material == 4);
    CHECK(!grid->intersect(down(2)) && grid->occluded(down()) && !grid->occluded(down(2)));

    std::vector<pixel> pixels(100);
    for (std::size_t i = 0; i < pixels.size(); i++)
        pixels[i].ray = down(0.011f * static_cast<float>(i) + 0.003f);
    for (const auto know : {hgrid::coherence::incoherent, hgrid::coherence::coherent}) {
        CHECK(grid->intersect_n(hgrid::field(pixels, &pixel::ray), hgrid::field(pixels, &pixel::hit),
                                know) == status::ok);
        CHECK(grid->occluded_n(hgrid::field(pixels, &pixel::ray),
                               hgrid::field(pixels, &pixel::is_dark), know) == status::ok);
        CHECK(grid->occluder_n(hgrid::field(pixels, &pixel::ray),
                               hgrid::field(pixels, &pixel::blocker), know) == status::ok);
        for (const pixel &p : pixels) {
            const auto single = grid->intersect(p.ray);
            CHECK(single ? single->primitive == p.hit.primitive
                         : p.hit.primitive == hgrid::invalid_id);
            CHECK(single.has_value() == (p.is_dark == 1));
            for (const auto named : {p.blocker, grid->occluder(p.ray)})
                CHECK(single ? named < s.faces.size() : named == hgrid::invalid_id);
        }
    }

    /* Contiguous rays, arrays of different lengths, and empty arrays. */
    const std::vector<hgrid::ray> rays(3, down());
    std::vector<hgrid::hit> hits(3);
    CHECK(grid->intersect_n(rays, hits, hgrid::coherence::coherent) == status::ok);
    CHECK(hits[2].primitive == top->primitive);
    hits.resize(2);
    CHECK(grid->intersect_n(rays, hits, hgrid::coherence::coherent) == status::invalid_answers);
    std::array<std::uint8_t, 4> bytes{};
    CHECK(grid->occluded_n(rays, bytes, hgrid::coherence::coherent) == status::invalid_answers);
    std::array<std::uint32_t, 2> names{};
    CHECK(grid->occluder_n(rays, names, hgrid::coherence::coherent) == status::invalid_answers);
    CHECK(grid->intersect_n({}, {}, hgrid::coherence::coherent) == status::ok);
    CHECK(hgrid::view().intersect_n(rays, hits, hgrid::coherence::coherent) != status::ok);

    hits.resize(3);
    const auto count = grid->intersect_all(down(), hits);
    CHECK(count && *count == 5 && is_near(hits[0].t, 96) && is_near(hits[2].t, 98));
    CHECK(*grid->intersect_all(down(), {}) == 5);
    CHECK(*grid->intersect_all(down(2), hits) == 0);
    CHECK(!hgrid::view().intersect_all(down(), hits));

    const auto closest = grid->closest_point({0.5f, 0.5f, 2.25f});
    CHECK(closest && is_near(closest->distance, 0.25f) && is_near(closest->position[2], 2));
    CHECK(!grid->closest_point({0.5f, 0.5f, 2.25f}, 0.2f));

    /* Rays that leave the surface, and go on through it to the next. */
    const auto at = grid->surface_at(down(), *top);
    CHECK(at && is_near(at->normal[2], 1) && at->is_front == 1 && is_near(at->position[2], 4));
    const auto from = [](const float (&start)[3], float z) {
        return hgrid::make_ray({start[0], start[1], start[2]}, {0, 0, z});
    };
    CHECK(!grid->occluded(from(at->above, 1)));
    const auto next = grid->intersect(from(at->below, -1));
    CHECK(next && s.faces[next->primitive].material == 3);
    CHECK(!grid->surface_at(down(), hgrid::hit{1, 0, 0, hgrid::invalid_id}));
    CHECK(!hgrid::view().surface_at(down(), *top));

    const auto mesh = grid->mesh_of();
    CHECK(mesh && mesh->triangle_count() == s.faces.size());
    CHECK(mesh->c().indices == s.mesh().c().indices);
    CHECK(hgrid::view().mesh_of().error() == status::not_a_grid);
}

static void check_joined()
{
    /* Two sheets, an empty mesh, and four sheets in another form: the highest of the last is on top. */
    const scene low(2), high(4);
    std::vector<std::uint32_t> masks(low.faces.size(), 2);
    const std::vector<hgrid::point> corners = {{0, 0, 9}, {1, 0, 9}, {0, 1, 9}};
    const std::vector<std::uint16_t> none;
    const std::array<hgrid::mesh, 3> meshes = {low.mesh().masks(masks), hgrid::mesh(corners, none),
                                               high.mesh()};
    std::vector<hgrid::part> parts(meshes.size());
    const auto joined = hgrid::mesh::join(meshes, parts);
    CHECK(joined && joined->triangle_count() == low.faces.size() + high.faces.size());
    const auto grid = hgrid::grid::build(*joined);
    CHECK(grid);
    const auto top = grid->intersect(down());
    CHECK(top && is_near(top->t, 97));
    const auto place = grid->locate(top->primitive);
    CHECK(place && place->geometry == 2 && high.faces[place->triangle].material == 3);
    const auto masked = grid->intersect(down(), hgrid::options().skip(top->primitive).mask(2));
    CHECK(masked && is_near(masked->t, 98));
    CHECK(!grid->locate(hgrid::invalid_id) && !hgrid::view().locate(0));
    const auto packed = grid->pack();
    CHECK(packed);
    const auto opened = hgrid::view::open(*packed);
    CHECK(opened && opened->locate(top->primitive)->triangle == place->triangle);

    CHECK(hgrid::mesh::join(meshes, hgrid::span<hgrid::part>(parts.data(), 2)).error() ==
          status::invalid_parts);
    CHECK(hgrid::mesh::join({}, {})->triangle_count() == 0);
    const std::array<hgrid::mesh, 1> again = {*joined};
    CHECK(hgrid::mesh::join(again, parts).error() == status::invalid_parts);
}

static void check_options()
{
    const scene s(5);
    std::vector<std::uint32_t> masks;
    for (const face &f : s.faces)
        masks.push_back(1u << f.material);
    const auto grid = hgrid::grid::build(s.mesh().masks(masks));
    CHECK(grid);
    const auto material = [&](const hgrid::optional<hgrid::hit> &hit) {
        return hit ? s.faces[hit->primitive].material : -1;
    };
    for (masks.pop_back();; masks.clear()) {
        CHECK(hgrid::grid::build(s.mesh().masks(masks)).error() == hgrid::status::invalid_masks);
        if (masks.empty())
            break;
    }
    CHECK(material(grid->intersect(down(), hgrid::options())) == 4);
    CHECK(material(grid->intersect(down(), hgrid::options().mask(0x6))) == 2);
    CHECK(material(grid->intersect(down(), hgrid::options().mask(0x40))) == -1);

    const auto up = hgrid::make_ray({0.31f, 0.57f, -100}, {0, 0, 1});
    using hgrid::culling;
    CHECK(material(grid->intersect(down(), hgrid::options().cull(culling::back))) == 4);
    CHECK(material(grid->intersect(down(), hgrid::options().cull(culling::front))) == -1);
    CHECK(material(grid->intersect(up, hgrid::options().cull(culling::back))) == -1);
    CHECK(material(grid->intersect(up, hgrid::options().cull(culling::front))) == 0);
    CHECK(grid->occluded(up, hgrid::options().cull(culling::front)));
    CHECK(!grid->occluded(up, hgrid::options().cull(culling::back)));

    const auto top = grid->intersect(down());
    CHECK(material(grid->intersect(down(), hgrid::options().skip(top->primitive))) == 3);
    const auto closest =
        grid->closest_point({0.31f, 0.57f, 9}, 100, hgrid::options().mask(0x2));
    CHECK(closest && is_near(closest->distance, 8));

    hgrid::counters work{};
    hgrid::options counting;
    CHECK(grid->intersect(down(), counting.count(work)));
    CHECK(work.primitive_tests > 0 && work.cell_steps > 0);
}

static bool is_below_256(const hgrid::hit &hit)
{
    return hit.primitive < 256;
}

static void check_filters()
{
    const scene s(5);
    const auto grid = hgrid::grid::build(s.mesh());
    CHECK(grid);
    const auto material = [&](const hgrid::optional<hgrid::hit> &hit) {
        return hit ? s.faces[hit->primitive].material : -1;
    };

    /* The filter sees hits from near to far, and the lambda keeps a state. */
    std::vector<std::int64_t> offered;
    auto below_three = [&](const hgrid::hit &hit) {
        offered.push_back(s.faces[hit.primitive].material);
        return offered.back() < 3;
    };
    hgrid::options options;
    options.filter(below_three);
    CHECK(material(grid->intersect(down(), options)) == 2);
    CHECK((offered == std::vector<std::int64_t>{4, 3, 2}));
    CHECK(grid->occluded(down(), options));

    auto second = [n = 0](const hgrid::hit &) mutable {
        return ++n == 2 ? hgrid::verdict::accept_and_stop : hgrid::verdict::reject;
    };
    CHECK(material(grid->intersect(down(), hgrid::options().filter(second))) == 3);

    /* All hits with a filter that rejects some, and one that rejects all. */
    std::vector<hgrid::hit> hits(5);
    auto odd = [&](const hgrid::hit &hit) { return s.faces[hit.primitive].material % 2 == 1; };
    const auto count = grid->intersect_all(down(), hits, hgrid::options().filter(odd));
    CHECK(count && *count == 2 && s.faces[hits[1].primitive].material == 1);
    const auto nothing = [](const hgrid::hit &) { return false; };
    CHECK(!grid->intersect(down(), hgrid::options().filter(nothing)));

    /* A filter of a batch gets the index of the ray. */
    const std::vector<hgrid::ray> rays(9, down());
    std::vector<hgrid::hit> batch(9);
    auto by_place = [&](std::size_t ray, const hgrid::hit &hit) {
        return s.faces[hit.primitive].material == static_cast<std::int64_t>(ray % 5)
                   ? hgrid::verdict::accept
                   : hgrid::verdict::reject;
    };
    for (const auto know : {hgrid::coherence::incoherent, hgrid::coherence::coherent}) {
        CHECK(grid->intersect_n(rays, batch, know, hgrid::options().filter(by_place)) == status::ok);
        for (std::size_t i = 0; i < batch.size(); i++)
            CHECK(s.faces[batch[i].primitive].material == static_cast<std::int64_t>(i % 5));
    }
    std::array<std::uint8_t, 9> dark{};
    CHECK(grid->occluded_n(rays, dark, hgrid::coherence::coherent,
                           hgrid::options().filter(nothing)) == status::ok);
    CHECK((dark == std::array<std::uint8_t, 9>{}));

    /* The filter is asked about sheets 2 and 3 only; sheet 1 is opaque. */
    std::vector<std::uint32_t> masks;
    for (const face &f : s.faces)
        masks.push_back(1u << f.material);
    const auto masked = hgrid::grid::build(s.mesh().masks(masks));
    const auto see_through = hgrid::options().mask(0xe).filter_mask(0xc);
    hgrid::options asking = see_through;
    offered.clear();
    CHECK(material(masked->intersect(down(), asking.filter(below_three))) == 2);
    CHECK((offered == std::vector<std::int64_t>{3, 2}));
    asking = see_through;
    CHECK(material(masked->intersect(down(), asking.filter(nothing))) == 1);
    const auto blocker = masked->occluder(down(), asking);
    CHECK(blocker < s.faces.size() && s.faces[blocker].material == 1);
    std::array<std::uint32_t, 9> blockers{};
    CHECK(masked->occluder_n(rays, blockers, hgrid::coherence::coherent, asking) == status::ok);
    CHECK(s.faces[blockers[8]].material == 1);
    CHECK(masked->occluder(down(), asking.mask(0xc)) == hgrid::invalid_id);

    /* A pointer to a function serves as a filter, too. */
    auto *function = is_below_256;
    CHECK(material(grid->intersect(down(), hgrid::options().filter(function))) == 1);
}

void check_queries()
{
    check_rays();
    check_joined();
    check_options();
    check_filters();
}
