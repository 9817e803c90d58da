// Shapes and scenes through hgrid.hpp.
#include "hpp.h"

#include <algorithm>
#include <iterator>

namespace {

struct ball {
    std::array<float, 6> box;
    float center[3];
};

alignas(64) unsigned char shape_index[hgrid::index_bound(64) / 64 * 64 + 64];
alignas(64) unsigned char scene_index[hgrid::scene_bound(8) / 64 * 64 + 64];
alignas(64) unsigned char grid_index[hgrid::index_bound(1) / 64 * 64 + 64];
alignas(64) unsigned char scratch[hgrid::scratch_bound(64) / 64 * 64 + 64];

// A ray with room for its answers.
struct pixel {
    hgrid::ray_f64 ray;
    hgrid::scene_hit hit;
    std::uint8_t is_dark;
};

bool is_same(const hgrid::scene_hit &one, const hgrid::scene_hit &other)
{
    const bool is_same_place = one.t == other.t && one.u == other.u && one.v == other.v;
    return is_same_place && one.primitive == other.primitive &&
           std::equal(std::begin(one.path), std::end(one.path), std::begin(other.path));
}

// Batches answer as single rays do.
void check_batches(const hgrid::scene &scene)
{
    using hgrid::status;
    std::vector<pixel> pixels(200);
    for (std::size_t i = 0; i < pixels.size(); i++) {
        const double x = -1.5 + 0.0625 * static_cast<double>(i % 50), y = i < 100 ? 0.25 : 10.5;
        pixels[i].ray = hgrid::make_ray_f64({x, y, 3}, {0, 0, -1}, 0, 100);
    }
    const auto rays = hgrid::field(pixels, &pixel::ray);
    const auto hits = hgrid::field(pixels, &pixel::hit);
    const auto dark = hgrid::field(pixels, &pixel::is_dark);
    std::size_t count = 0;
    for (const auto know : {hgrid::coherence::incoherent, hgrid::coherence::coherent}) {
        CHECK(scene.intersect_n(rays, hits, know) == status::ok);
        CHECK(scene.occluded_n(rays, dark, know) == status::ok);
        for (const pixel &p : pixels) {
            const auto alone = scene.intersect(p.ray);
            CHECK(alone ? is_same(*alone, p.hit) : p.hit.primitive == hgrid::invalid_id);
            CHECK(alone.has_value() == (p.is_dark == 1) && scene.occluded(p.ray) == (p.is_dark == 1));
            count += p.is_dark;
        }
    }
    CHECK(count > 40 && count < 360);

    // With options: scratch to sort in, and a filter that accepts one instance.
    std::vector<hgrid::byte> memory(16 * pixels.size());
    CHECK(scene.intersect_n(rays, hits, hgrid::coherence::incoherent, hgrid::scene_options().sort_in(memory)) ==
          status::ok);
    std::vector<std::uint32_t> shown;
    hgrid::counters work{};
    auto second = [&](const hgrid::scene_hit &hit) {
        shown.push_back(hit.path[0]);
        return hit.path[0] == 1;
    };
    hgrid::scene_options asking;
    asking.filter(second).filter_mask(2).count(work).cull(hgrid::culling::none).mask(0xffffffffu);
    std::vector<hgrid::scene_hit> filtered(pixels.size());
    CHECK(asking.c().filter_mask == 2);
    CHECK(scene.intersect_n(rays, filtered, hgrid::coherence::coherent, asking) == status::ok);
    CHECK(!shown.empty() && work.primitive_tests > 0);
    CHECK(scene.occluded_n(rays, dark, hgrid::coherence::coherent, asking) == status::ok);
    for (std::size_t i = 0; i < pixels.size(); i++) {
        const auto alone = scene.intersect(pixels[i].ray, asking);
        CHECK(alone ? is_same(*alone, filtered[i]) : filtered[i].primitive == hgrid::invalid_id);
        CHECK(scene.occluded(pixels[i].ray, asking) == (pixels[i].is_dark == 1));
    }
    std::vector<unsigned> asked(pixels.size());
    auto reject = [&](std::size_t place, const hgrid::scene_hit &) { return asked[place]++, false; };
    asking.filter(reject).filter_mask(0);
    CHECK(scene.intersect_n(rays, filtered, hgrid::coherence::coherent, asking) == status::ok);
    for (std::size_t i = 0; i < pixels.size(); i++) {
        unsigned calls = 0;
        auto refuse = [&](const hgrid::scene_hit &) { return calls++, false; };
        scene.intersect(pixels[i].ray, asking.filter(refuse));
        CHECK(asked[i] == calls);
    }
    CHECK(asked != std::vector<unsigned>(pixels.size()));
    auto none = [](const hgrid::scene_hit &) { return hgrid::verdict::reject; };
    CHECK(!scene.occluded(hgrid::make_ray_f64({0.25, 0.25, 3}, {0, 0, -1}), hgrid::scene_options().filter(none)));

    // Arrays of different lengths, empty arrays, and an empty view.
    filtered.resize(2);
    std::array<std::uint8_t, 4> bytes{};
    CHECK(scene.intersect_n(rays, filtered, hgrid::coherence::coherent) == status::invalid_answers);
    CHECK(scene.occluded_n(rays, bytes, hgrid::coherence::coherent) == status::invalid_answers);
    CHECK(scene.intersect_n({}, {}, hgrid::coherence::coherent) == status::ok);
    CHECK(hgrid::scene().occluded_n(rays, dark, hgrid::coherence::coherent) == status::not_a_grid);
}

// The normal of a sphere in an instance that shears and scales is the object's normal times the inverse transpose.
void check_normals()
{
    const std::array<std::array<float, 6>, 1> box = {{{{-1, -1, -1, 1, 1, 1}}}};
    auto test = [](std::uint32_t, const hgrid::ray &along, hgrid::shape_hit &found) {
        const float *o = along.origin, *d = along.direction;
        const float a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        const float b = o[0] * d[0] + o[1] * d[1] + o[2] * d[2];
        const float c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - 1;
        const float root = b * b - a * c;
        found = hgrid::shape_hit{(-b - std::sqrt(root > 0 ? root : 0)) / a, 0, 0};
        return root >= 0;
    };
    auto shape_memory = hgrid::memory::allocate(hgrid::index_bound(1));
    auto scene_memory = hgrid::memory::allocate(hgrid::scene_bound(1));
    CHECK(shape_memory && scene_memory);
    const auto shapes = hgrid::shapes::build(hgrid::boxes(box, test), {}, *shape_memory,
                                             hgrid::as_writable_bytes(scratch));
    CHECK(shapes);
    const auto sphere = hgrid::make_object(*shapes);
    CHECK(sphere);
    const std::array<hgrid::object, 1> objects = {{*sphere}};
    // x grows by half of y, and z is doubled: the inverse takes half of y from x, and halves z.
    std::array<hgrid::instance, 1> sheared;
    sheared[0].linear[0][1] = 0.5f, sheared[0].linear[2][2] = 2, sheared[0].translation[0] = 100;
    const auto scene = hgrid::scene::build(sheared, objects, {}, *scene_memory, hgrid::as_writable_bytes(scratch));
    CHECK(scene);
    int count = 0;
    for (double x = -0.9; x < 1; x += 0.3)
        for (double y = -0.9; y < 1; y += 0.3) {
            const auto hit = scene->intersect(hgrid::make_ray_f64({100 + x, y, 5}, {0, 0, -1}));
            if (!hit)
                continue;
            // The place in the sphere is its normal there.
            const hgrid::point in_object = {
                {static_cast<float>(x - y / 2), static_cast<float>(y), (5 - hit->t) / 2}};
            const hgrid::point expected = {{in_object[0], in_object[1] - in_object[0] / 2, in_object[2] / 2}};
            const float length = std::sqrt(expected[0] * expected[0] + expected[1] * expected[1] +
                                           expected[2] * expected[2]);
            const hgrid::point twice = {{2 * in_object[0], 2 * in_object[1], 2 * in_object[2]}};
            const hgrid::point found = scene->normal(*hit, in_object), same = scene->normal(*hit, twice);
            for (std::size_t i = 0; i < 3; i++) {
                CHECK(is_near(found[i], expected[i] / length) && is_near(same[i], found[i]));
                // Without the object's normal there is none, as the hit names no triangle.
                CHECK(is_near(scene->normal(*hit)[i], 0) && is_near(scene->normal(*hit, {})[i], 0));
            }
            count++;
        }
    CHECK(count > 20);
    const hgrid::scene_hit nothing = {1, 0, 0, hgrid::invalid_id, {0, 0, 0, 0}};
    CHECK(is_near(hgrid::scene().normal(nothing, {{0, 0, 1}})[2], 0));
}

// A refit's view in the same variable is what a scene shows then. A vector with room keeps the addresses of its views.
void check_objects_that_move()
{
    const std::vector<std::uint32_t> indices = {0, 1, 2};
    const auto at = [](float z) {
        return std::vector<std::array<float, 3>>{{{0, 0, z}}, {{1, 0, z}}, {{0, 1, z}}};
    };
    const auto corners = at(0), lower = at(-2), lowest = at(-4);
    std::vector<hgrid::view> views;
    std::vector<hgrid::shapes> trees;
    std::vector<hgrid::scene> scenes;
    views.reserve(2), trees.reserve(2), scenes.reserve(2);
    auto view_index = hgrid::memory::allocate(hgrid::index_bound(1));
    auto tree_index = hgrid::memory::allocate(hgrid::index_bound(1));
    auto inner_index = hgrid::memory::allocate(hgrid::scene_bound(2));
    auto outer_index = hgrid::memory::allocate(hgrid::scene_bound(1));
    CHECK(view_index && tree_index && inner_index && outer_index);
    const auto room = hgrid::as_writable_bytes(scratch);
    views.push_back(*hgrid::view::build(hgrid::mesh(corners, indices), {}, *view_index, room));
    // A floor that a test finds, beside the triangle.
    float height = 0;
    auto test = [&](std::uint32_t, const hgrid::ray &along, hgrid::shape_hit &found) {
        found = hgrid::shape_hit{(height - along.origin[2]) / along.direction[2], 0, 0};
        return true;
    };
    std::array<std::array<float, 6>, 1> box = {{{{4, 0, -0.1f, 5, 1, 0.1f}}}};
    trees.push_back(*hgrid::shapes::build(hgrid::boxes(box, test), {}, *tree_index, room));
    const std::array<hgrid::object, 2> inside = {{*hgrid::make_object(views[0]), *hgrid::make_object(trees[0])}};
    const std::array<hgrid::instance, 2> both = {{hgrid::instance(0), hgrid::instance(1)}};
    scenes.push_back(*hgrid::scene::build(both, inside, {}, *inner_index, room));
    const std::array<hgrid::object, 1> outside = {{*hgrid::make_object(scenes[0])}};
    const std::array<hgrid::instance, 1> all = {{hgrid::instance(0)}};
    auto outer = hgrid::scene::build(all, outside, {}, *outer_index, room);
    CHECK(outer);
    const auto on_view = hgrid::make_ray_f64({0.25, 0.25, 1}, {0, 0, -1});
    const auto on_tree = hgrid::make_ray_f64({4.5, 0.5, 1}, {0, 0, -1});
    CHECK(is_near(outer->intersect(on_view)->t, 1) && is_near(outer->intersect(on_tree)->t, 1));
    // There is room for one more of each.
    views.emplace_back(), trees.emplace_back(), scenes.emplace_back();
    CHECK(is_near(outer->intersect(on_view)->t, 1) && is_near(outer->intersect(on_tree)->t, 1));

    height = -2;
    box[0][2] = -2.1f, box[0][5] = -1.9f;
    views[0] = *hgrid::view::refit(hgrid::mesh(lower, indices), *view_index);
    trees[0] = *hgrid::shapes::refit(hgrid::boxes(box, test), *tree_index);
    scenes[0] = *hgrid::scene::refit(both, inside, *inner_index);
    *outer = *hgrid::scene::refit(all, outside, *outer_index);
    CHECK(is_near(outer->intersect(on_view)->t, 3) && is_near(outer->intersect(on_tree)->t, 3));

    // A grid does so itself.
    auto owner = hgrid::grid::build(hgrid::mesh(corners, indices));
    CHECK(owner);
    const std::array<hgrid::object, 1> owned = {{*hgrid::make_object(*owner)}};
    outer = hgrid::scene::build(all, owned, {}, *outer_index, room);
    CHECK(outer && is_near(outer->intersect(on_view)->t, 1));
    CHECK(owner->refit(hgrid::mesh(lowest, indices)));
    *outer = *hgrid::scene::refit(all, owned, *outer_index);
    CHECK(is_near(outer->intersect(on_view)->t, 5));
}

// C refuses boxes without a mask for each shape, too.
void check_masks_of_shapes()
{
    const std::array<std::array<float, 6>, 2> all = {{{{0, 0, 0, 1, 1, 1}}, {{2, 0, 0, 3, 1, 1}}}};
    auto test = [](std::uint32_t, const hgrid::ray &, hgrid::shape_hit &found) {
        found = hgrid::shape_hit{1, 0, 0};
        return true;
    };
    const auto room = hgrid::as_writable_bytes(scratch), index = hgrid::as_writable_bytes(shape_index);
    const auto ray = hgrid::make_ray({0.5f, 0.5f, 3}, {0, 0, -1});
    std::vector<std::uint32_t> masks = {1, 2};
    hgrid::boxes boxes(all, test);
    const auto shapes = hgrid::shapes::build(boxes.masks(masks), {}, index, room);
    CHECK(shapes && shapes->occluded(ray, hgrid::options().mask(1)));
    CHECK(!shapes->occluded(ray, hgrid::options().mask(2)));
    for (masks.pop_back();; masks.clear()) {
        boxes.masks(masks);
        CHECK(hgrid::shapes::build(boxes, {}, index, room).error() == hgrid::status::invalid_masks);
        CHECK(hgrid::shapes::open(index, boxes).error() == hgrid::status::invalid_masks);
        CHECK(hgrid::shapes::refit(boxes, index).error() == hgrid::status::invalid_masks);
        hgrid_shapes raw = HGRID_SHAPES_INIT;
        CHECK(hgrid_open_shapes(index.data(), index.size(), &boxes.c(), &raw) == HGRID_ERROR_INVALID_MASKS);
        if (masks.empty())
            break;
    }
}

} // namespace

void check_scenes()
{
    check_normals();
    check_objects_that_move();
    check_masks_of_shapes();
    // Cubes in a row; the test finds hits on their fronts.
    std::vector<ball> all;
    for (int i = 0; i < 64; i++) {
        const float x = static_cast<float>(2 * i);
        all.push_back(ball{{{x, 0, 0, x + 1, 1, 1}}, {x, 0, 0}});
    }
    auto test = [&](std::uint32_t shape, const hgrid::ray &along, hgrid::shape_hit &found) {
        const float x = along.origin[0] - all[shape].center[0];
        found = hgrid::shape_hit{(1 - along.origin[2]) / along.direction[2], x, 0};
        return x >= 0 && x <= 1;
    };
    const hgrid::boxes boxes(hgrid::field(all, &ball::box), test);
    const auto shapes = hgrid::shapes::build(boxes, hgrid::config(), hgrid::as_writable_bytes(shape_index),
                                             hgrid::as_writable_bytes(scratch));
    CHECK(shapes && shapes->validate(hgrid::as_writable_bytes(scratch)) == hgrid::status::ok);
    const auto hit = shapes->intersect(hgrid::make_ray({10.25f, 0.5f, 3}, {0, 0, -1}));
    CHECK(hit && hit->primitive == 5 && hit->t == 2 && hit->u == 0.25f);
    CHECK(!shapes->occluded(hgrid::make_ray({11.5f, 0.5f, 3}, {0, 0, -1})));
    hgrid::options without_five;
    without_five.skip(5);
    const auto at_five = hgrid::make_ray({10.25f, 0.5f, 3}, {0, 0, -1});
    CHECK(shapes->occluded(at_five) && !shapes->occluded(at_five, without_five));
    CHECK(!shapes->intersect(at_five, without_five));
    const auto again = hgrid::shapes::open(hgrid::as_bytes(shape_index), boxes);
    CHECK(again && again->occluded(hgrid::make_ray({0.5f, 0.5f, 3}, {0, 0, -1})));
    CHECK(!hgrid::shapes().occluded(hgrid::make_ray({0.5f, 0.5f, 3}, {0, 0, -1})));
    // A batch in which every second ray passes between the cubes.
    std::vector<hgrid::ray> many;
    for (int i = 0; i < 64; i++)
        many.push_back(hgrid::make_ray({0.5f + static_cast<float>(i), 0.5f, 3}, {0, 0, -1}));
    std::vector<hgrid::hit> many_hits(many.size());
    std::vector<std::uint8_t> dark(many.size());
    hgrid::options without;
    without.skip(0);
    CHECK(shapes->intersect_n(many, many_hits, hgrid::coherence::coherent) == hgrid::status::ok);
    CHECK(shapes->occluded_n(many, dark, hgrid::coherence::incoherent, without) == hgrid::status::ok);
    for (std::uint32_t i = 0; i < 64; i++) {
        CHECK(many_hits[i].primitive == (i % 2 == 0 ? i / 2 : hgrid::invalid_id));
        CHECK(dark[i] == (i % 2 == 0 && i > 0 ? 1 : 0));
    }
    CHECK(shapes->intersect_n(many, many_hits, hgrid::coherence::coherent, without) == hgrid::status::ok);
    CHECK(many_hits[0].primitive == hgrid::invalid_id && many_hits[2].primitive == 1);
    dark.pop_back();
    CHECK(shapes->occluded_n(many, dark, hgrid::coherence::coherent) == hgrid::status::invalid_answers);

    // A triangle twice, and the cubes.
    const std::vector<std::array<float, 3>> corners = {{{0, 0, 0}}, {{1, 0, 0}}, {{0, 1, 0}}};
    const std::vector<std::uint32_t> indices = {0, 1, 2};
    const auto grid = hgrid::view::build(hgrid::mesh(corners, indices), hgrid::config(),
                                         hgrid::as_writable_bytes(grid_index), hgrid::as_writable_bytes(scratch));
    CHECK(grid);
    const std::vector<std::array<float, 3>> lower = {{{0, 0, -2}}, {{1, 0, -2}}, {{0, 1, -2}}};
    hgrid::refit_report costs;
    const auto down = hgrid::view::refit(hgrid::mesh(lower, indices), hgrid::as_writable_bytes(grid_index), &costs);
    const auto inwards = hgrid::make_ray({0.25f, 0.25f, 1}, {0, 0, -1});
    CHECK(down && down->intersect(inwards)->t == 3 && costs.cost_after > 0);
    const auto up = hgrid::view::refit(hgrid::mesh(corners, indices), hgrid::as_writable_bytes(grid_index));
    CHECK(up && up->intersect(inwards)->t == 1 && up->intersect(inwards, {})->primitive == 0);
    auto owner = hgrid::grid::build(hgrid::mesh(corners, indices));
    CHECK(owner && owner->refit(hgrid::mesh(lower, indices)) && owner->intersect(inwards)->t == 3);
    const std::vector<std::uint32_t> two = {0, 1, 2, 0, 1, 2};
    CHECK(owner->refit(hgrid::mesh(lower, two)).error() == hgrid::status::mesh_mismatch);
    CHECK(owner->intersect(inwards)->t == 3);

    // The report of an owner's refit says which triangle is to blame, as those of the views do.
    const std::vector<std::array<float, 3>> high = {{{0, 0, 0}}, {{1, 0, 0}}, {{0, 1, 0}}, {{0, 0, 9}}};
    std::vector<std::array<std::uint32_t, 3>> pair = {{{0, 1, 2}}, {{1, 2, 3}}};
    auto of_pair = hgrid::grid::build(hgrid::mesh(high, pair));
    hgrid::refit_report blame = {};
    const auto cost = of_pair->refit(hgrid::mesh(high, pair), &blame);
    CHECK(cost && cost->cost_after > 0 && blame.triangle == hgrid::invalid_id);
    CHECK(blame.cost_after >= cost->cost_after && blame.cost_after <= cost->cost_after);
    auto damaged = pair;
    damaged[1][0] = 4;
    CHECK(of_pair->refit(hgrid::mesh(high, damaged), &blame).error() == hgrid::status::index_out_of_range);
    CHECK(blame.triangle == 1 && of_pair->intersect(inwards)->t == 1);
    const auto one = hgrid::make_object(*up), other = hgrid::make_object(*shapes);
    CHECK(one && other);
    const std::array<hgrid::object, 2> objects = {{*one, *other}};
    std::array<hgrid::instance, 3> instances;
    instances[1].translation[2] = -5, instances[1].linear[0][0] = -1;
    instances[2] = hgrid::instance(1), instances[2].translation[1] = 10;
    const ::hgrid_instance usual = HGRID_INSTANCE_INIT;
    CHECK(instances[0].object == usual.object && hgrid::instance(usual).linear[2][2] == 1);
    const auto scene = hgrid::scene::build(instances, objects, hgrid::config(),
                                           hgrid::as_writable_bytes(scene_index),
                                           hgrid::as_writable_bytes(scratch));
    CHECK(scene && scene->validate(hgrid::as_writable_bytes(scratch)) == hgrid::status::ok);
    const auto left = hgrid::make_ray_f64({-0.25, 0.25, 1}, {0, 0, -1}, 0, 100);
    const auto found = scene->intersect(left);
    CHECK(found && found->path[0] == 1 && found->t == 6);
    const hgrid::point normal = scene->normal(*found);
    CHECK(normal[2] == 1 || normal[2] == -1);
    CHECK(scene->normal(*found, {{0, 0, 7}})[2] == 1 && scene->normal(*found, {{3, 0, 0}})[0] == -1);
    const auto at = scene->surface_at(left, *found);
    CHECK(at && at->normal[2] == 1 && at->position[2] == -5 && at->above[2] > -5 && at->below[2] < -5);
    CHECK(!scene->surface_at(left, {1, 0, 0, hgrid::invalid_id, {0, 0, 0, 0}}));
    CHECK(scene->occluded(hgrid::make_ray_f64({10.25, 10.5, 3}, {0, 0, -1})));
    CHECK(hgrid::scene::open(hgrid::as_bytes(scene_index), objects));
    CHECK(!hgrid::scene().occluded(left));
    check_batches(*scene);
    instances[1].translation[2] = -7;
    const auto moved = hgrid::scene::refit(instances, objects, hgrid::as_writable_bytes(scene_index));
    CHECK(moved && moved->intersect(left)->t == 8);
    CHECK(hgrid::shapes::refit(boxes, hgrid::as_writable_bytes(shape_index)));
    const auto enough = hgrid::scene::bound(3, {});
    CHECK(enough && enough->index_bytes <= hgrid::scene_bound(3));
    CHECK(hgrid::scene::bound(3, hgrid::method::fixed).error() == hgrid::status::invalid_method);
    // A scene packs with all that it shows, but not with shapes, which stay with the caller.
    CHECK(moved->packed_bytes() == 0 && moved->pack().error() == hgrid::status::other_content);
    alignas(64) static unsigned char plain_index[hgrid::scene_bound(8) / 64 * 64 + 64];
    const auto plain = hgrid::scene::build(hgrid::span<const hgrid::instance>(instances.data(), 2), objects,
                                           hgrid::config(), hgrid::as_writable_bytes(plain_index),
                                           hgrid::as_writable_bytes(scratch));
    const auto packed = plain->pack();
    CHECK(plain && packed && packed->size() == plain->packed_bytes());
    auto views = hgrid::memory::allocate(hgrid::scene::view_bytes(*packed));
    CHECK(views && views->size() > 0 && hgrid::scene::view_bytes(hgrid::as_bytes(scene_index)) == 0);
    const auto whole = hgrid::scene::open_packed(*packed, *views);
    CHECK(whole->box()[0] < whole->box()[3] && whole->grid_of(*found).box()[0] < whole->grid_of(*found).box()[3]);
    CHECK(whole && whole->intersect(left)->t == 8);
    CHECK(whole->instance_of(*found).translation[2] == -7 && whole->grid_of(*found).validate_bytes() > 0);
    CHECK(whole->instance_at(*found, 0)->translation[2] == -7 && !whole->instance_at(*found, 1));
    CHECK(!whole->instance_at(hgrid::scene_hit{0, 0, 0, 0, {99, 0, 0, 0}}, 0));
    CHECK(hgrid::scene::open_packed(*packed, *views, hgrid::as_writable_bytes(scratch)));
    CHECK(static_cast<hgrid::content>(hgrid::peek(*packed)->content) == hgrid::content::packed_scene);
    instances[0].object = 2;
    const auto refused = hgrid::scene::build(instances, objects, hgrid::config(),
                                             hgrid::as_writable_bytes(scene_index),
                                             hgrid::as_writable_bytes(scratch));
    CHECK(!refused && refused.error() == hgrid::status::instance_object);
    const hgrid::view none;
    CHECK(hgrid::make_object(none).error() == hgrid::status::not_a_grid);
}
