/* Scenes packed with all that they show in one blob: the same answers elsewhere, refusals, NULL in every pointer. */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static hgrid_object grids[1], objects[3];
static hgrid_scene inner, scene, opened;

enum { INDEX_BYTES = 4096, SCRATCH_BYTES = 4096 };

/* The blob, memory for its views, and scratch for its validation, with their sizes. */
static void *file, *views, *scratch;
static size_t file_bytes, view_bytes;

static hgrid_ray_f64 ray_of(int i)
{
    hgrid_ray_f64 ray = {{0.02 * (i % 100) - 0.2, 0.012 * i, 50}, {0, 0, -1}, 0, INFINITY, 0};
    ray.direction[0] = 0.001f * (float)(i % 7);
    return ray;
}

/* Builds two scenes that both show the grid, one of them also inside the other. */
static void prepare(void)
{
    hgrid_instance two[2] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    hgrid_instance three[3] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    grid = build_exactly(&mesh, NULL, NULL, NULL);
    scratch = guarded(SCRATCH_BYTES);
    EXPECT(HGRID_OK, hgrid_object_grid(&grid, &grids[0]));
    two[0].id = 30, two[1].id = 31, three[0].id = 10, three[1].id = 11, three[2].id = 12;
    two[1].translation[0] = 1.5, two[1].linear[2][2] = -1;
    EXPECT(HGRID_OK, hgrid_build_scene(two, 2, grids, 1, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &inner, NULL));
    EXPECT(HGRID_OK, hgrid_object_scene(&inner, &objects[0]));
    objects[1] = objects[2] = grids[0];
    three[1].object = 1, three[1].translation[1] = 1.25;
    three[2].object = 2, three[2].linear[0][0] = 2, three[2].translation[2] = 20;
    EXPECT(HGRID_OK, hgrid_build_scene(three, 3, objects, 3, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &scene, NULL));
}

static void a_packed_scene_needs_nothing_else(void)
{
    uint64_t bytes = 0, again = 0;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack_scene(&scene, NULL, 0, &bytes));
    file_bytes = (size_t)bytes;
    file = guarded(file_bytes);
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack_scene(&scene, file, file_bytes - 1, &again));
    CHECK(again == bytes && all_bytes_are(file, file_bytes, 0xc7));
    EXPECT(HGRID_OK, hgrid_pack_scene(&scene, file, file_bytes, &again));
    CHECK(again == bytes);
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_OK, hgrid_peek(file, 128, &info));
    CHECK(info.content == HGRID_CONTENT_PACKED_SCENE && info.has_mesh == 1 && info.total_bytes == bytes);
    /* The blob has the grid once. */
    CHECK(info.triangle_count == 2);

    /* Open it elsewhere, in memory of exactly the size. */
    file = guarded_copy(file, file_bytes);
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL,
           hgrid_open_packed_scene(file, file_bytes, NULL, 0, NULL, 0, &bytes, &opened));
    view_bytes = (size_t)bytes;
    /* Guarded memory ends at a page, so round up for a start at a multiple of 64. */
    views = guarded((view_bytes + 63) / 64 * 64);
    EXPECT(HGRID_OK,
           hgrid_open_packed_scene(file, file_bytes, views, view_bytes, NULL, 0, &bytes, &opened));
    CHECK(bytes == view_bytes);
    EXPECT(HGRID_OK, hgrid_open_packed_scene(file, file_bytes, views, view_bytes, scratch, file_bytes / 64, &bytes,
                                             &opened));
    int hits = 0;
    for (int i = 0; i < 200; i++) {
        const hgrid_ray_f64 ray = ray_of(i);
        hgrid_scene_hit one, other;
        const bool is_hit = hgrid_intersect_scene(&scene, &ray, NULL, &one);
        CHECK(hgrid_intersect_scene(&opened, &ray, NULL, &other) == is_hit);
        CHECK(hgrid_occluded_scene(&opened, &ray, NULL) == is_hit);
        CHECK(!is_hit || memcmp(&one, &other, sizeof one) == 0);
        hits += is_hit;
        if (!is_hit)
            continue;
        /* Instance and grid come from the blob. */
        hgrid_instance instance;
        hgrid_grid found;
        hgrid_mesh own = HGRID_MESH_INIT;
        CHECK(hgrid_scene_locate(&opened, &other, &instance, &found));
        CHECK(instance.id == (other.path[0] == 0 ? 30 + other.path[1] : 10 + other.path[0]));
        /* Every instance on the way, and none behind. */
        CHECK(hgrid_scene_instance(&opened, &other, 0, &instance) && instance.id == 10 + other.path[0]);
        const bool is_nested = other.path[1] != HGRID_INVALID_ID;
        CHECK(hgrid_scene_instance(&opened, &other, 1, &instance) == is_nested);
        CHECK(instance.id == (is_nested ? 30 + other.path[1] : 10 + other.path[0]));
        CHECK(!hgrid_scene_instance(&opened, &other, 2, &instance));
        CHECK(!hgrid_scene_instance(&opened, &other, UINT32_MAX, &instance));
        EXPECT(HGRID_OK, hgrid_mesh_of(&found, &own));
        CHECK(own.triangle_count == TRIANGLES && (const char *)own.positions > (const char *)file);
    }
    CHECK(hits > 40);

    /* Packing it again gives the same bytes. */
    void *copy = guarded(file_bytes);
    EXPECT(HGRID_OK, hgrid_pack_scene(&opened, copy, file_bytes, &bytes));
    CHECK(memcmp(copy, file, file_bytes) == 0);
}

static bool nowhere(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    (void)context, (void)shape, (void)ray, (void)hit;
    return false;
}

/* Checks that a blob does not open. */
static void no_scene(hgrid_status expected, const void *blob, size_t blob_bytes, void *room, size_t room_bytes,
                     void *proof_room, size_t proof_bytes)
{
    uint64_t bytes = 7;
    hgrid_scene view;
    memset(&view, 0xc7, sizeof view);
    EXPECT_OF("hgrid_open_packed_scene(", expected,
              hgrid_open_packed_scene(blob, blob_bytes, room, room_bytes, proof_room, proof_bytes, &bytes, &view));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    CHECK(bytes == (expected == HGRID_ERROR_INDEX_TOO_SMALL ? view_bytes : 7));
}

static void what_is_refused(void)
{
    char *const at = (char *)file, *const room = (char *)views;
    const size_t n = file_bytes, m = view_bytes;
    no_scene(HGRID_ERROR_INDEX_TOO_SMALL, at, n, room, m - 1, NULL, 0);
    no_scene(HGRID_ERROR_MISALIGNED, at + 8, n - 8, room, m, NULL, 0);
    no_scene(HGRID_ERROR_MISALIGNED, at, n, room + 8, m - 8, NULL, 0);
    no_scene(HGRID_ERROR_OVERLAP, at, n, at, n, NULL, 0);
    no_scene(HGRID_ERROR_OVERLAP, at, n, room, m, room, 64);
    no_scene(HGRID_ERROR_OVERLAP, at, n, room, m, at + n - 64, 64);
    no_scene(HGRID_ERROR_SCRATCH_TOO_SMALL, at, n, room, m, scratch, 3);
    no_scene(HGRID_ERROR_NULL_ARGUMENT, at, n, room, m, NULL, 3);
    no_scene(HGRID_ERROR_TRUNCATED, at, n - 1, room, m, NULL, 0);
    no_scene(HGRID_ERROR_TRUNCATED, at, 127, room, m, NULL, 0);

    /* A damaged header, a reference to nothing, and a box that is not that of its instance. */
    char *copy = (char *)guarded_copy(file, n);
    copy[33] ^= 1;
    no_scene(HGRID_ERROR_CORRUPT, copy, n, room, m, NULL, 0);
    copy = (char *)guarded_copy(file, n);
    copy[128] ^= 0x55;
    no_scene(HGRID_ERROR_CORRUPT, copy, n, room, m, NULL, 0);
    copy = (char *)guarded_copy(file, n);
    copy[n - 72 * 3 - 40] ^= 0x40;
    no_scene(HGRID_ERROR_CORRUPT, copy, n, room, m, scratch, SCRATCH_BYTES);

    /* Blobs of other content. */
    uint64_t bytes;
    hgrid_scene view;
    hgrid_grid none;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(&grid, NULL, 0, &bytes));
    void *packed = guarded((size_t)bytes);
    EXPECT(HGRID_OK, hgrid_pack(&grid, packed, (size_t)bytes, &bytes));
    no_scene(HGRID_ERROR_OTHER_CONTENT, packed, (size_t)bytes, room, m, NULL, 0);
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open(file, n, NULL, &none));
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open_scene(file, n, objects, 3, &view));

    /* Pack over the packed blob, over arrays in use, and to a misaligned address. The views were overwritten
     * above. */
    EXPECT(HGRID_OK, hgrid_open_packed_scene(at, n, room, m, NULL, 0, &bytes, &opened));
    bytes = 7;
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack_scene(&opened, at, n, &bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack_scene(&opened, at + 192, 64, &bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack_scene(&scene, mesh_data.positions, 64, &bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack_scene(&scene, objects, sizeof objects, &bytes));
    copy = (char *)guarded((n + 127) / 64 * 64);
    EXPECT(HGRID_ERROR_MISALIGNED, hgrid_pack_scene(&scene, copy + 8, n, &bytes));
    const hgrid_scene zeros = HGRID_SCENE_INIT;
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_pack_scene(&zeros, copy, n, &bytes));

    /* The test of a shape is code, which cannot be stored. */
    static const float box[6] = {0, 0, 0, 1, 1, 1};
    hgrid_boxes boxes = HGRID_BOXES_INIT;
    hgrid_shapes shapes;
    hgrid_object object;
    const hgrid_instance here = HGRID_INSTANCE_INIT;
    boxes.boxes = box, boxes.count = 1, boxes.test = nowhere;
    EXPECT(HGRID_OK, hgrid_build_shapes(&boxes, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch, SCRATCH_BYTES,
                                        &shapes, NULL));
    EXPECT(HGRID_OK, hgrid_object_shapes(&shapes, &object));
    EXPECT(HGRID_OK, hgrid_build_scene(&here, 1, &object, 1, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &view, NULL));
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_pack_scene(&view, copy, n, &bytes));
    CHECK(bytes == 7);

    /* A mesh whose triangle has an index out of range. */
    const uint32_t was = mesh_data.indices[5][1];
    mesh_data.indices[5][1] = VERTICES;
    EXPECT(HGRID_ERROR_INDEX_OUT_OF_RANGE, hgrid_pack_scene(&scene, copy, n, &bytes));
    mesh_data.indices[5][1] = was;
}

/* Views of objects that were cleared or overwritten after the scene was built. */
static void lost_views_are_refused(void)
{
    const size_t n = file_bytes;
    const hgrid_scene zeros = HGRID_SCENE_INIT;
    const hgrid_grid none = HGRID_GRID_INIT;
    char *const copy = (char *)guarded((n + 63) / 64 * 64);
    uint64_t bytes = 7;
    hgrid_scene view;

    /* A view that was cleared, behind one that was not: nothing is written, and no size is told. */
    hgrid_grid cleared = grid;
    hgrid_object pair[2];
    hgrid_instance both[2] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    both[1].object = 1;
    EXPECT(HGRID_OK, hgrid_object_grid(&grid, &pair[0]));
    EXPECT(HGRID_OK, hgrid_object_grid(&cleared, &pair[1]));
    EXPECT(HGRID_OK, hgrid_build_scene(both, 2, pair, 2, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &view, NULL));
    cleared = none;
    memset(copy, 3, n);
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_pack_scene(&view, NULL, 0, &bytes));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_pack_scene(&view, copy, n, &bytes));
    for (size_t i = 0; i < n; i++)
        CHECK(copy[i] == 3);
    CHECK(bytes == 7);

    /* The same with a view of a scene; and one that was overwritten by the view of the scene that shows it. */
    static hgrid_scene inside, outside;
    hgrid_object shown;
    const hgrid_instance one = HGRID_INSTANCE_INIT;
    EXPECT(HGRID_OK, hgrid_build_scene(&one, 1, &pair[0], 1, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &inside, NULL));
    EXPECT(HGRID_OK, hgrid_object_scene(&inside, &shown));
    void *const index = guarded(INDEX_BYTES);
    EXPECT(HGRID_OK, hgrid_build_scene(&one, 1, &shown, 1, NULL, index, INDEX_BYTES, scratch, SCRATCH_BYTES,
                                       &outside, NULL));
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack_scene(&outside, NULL, 0, &bytes));
    bytes = 7;
    const hgrid_ray_f64 ray = ray_of(50);
    hgrid_scene_hit found;
    CHECK(hgrid_intersect_scene(&outside, &ray, NULL, &found));
    const hgrid_scene was_inside = inside;
    inside = zeros;
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_pack_scene(&outside, copy, n, &bytes));
    inside = outside;
    EXPECT(HGRID_ERROR_TOO_DEEP, hgrid_pack_scene(&outside, NULL, 0, &bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack_scene(&outside, copy, n, &bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_scene(&outside, scratch, SCRATCH_BYTES));
    CHECK(!hgrid_intersect_scene(&outside, &ray, NULL, &found));
    inside = was_inside;
    CHECK(hgrid_intersect_scene(&outside, &ray, NULL, &found));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_scene(&outside, &outside, 4));
    for (size_t i = 0; i < n; i++)
        CHECK(copy[i] == 3);
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build_scene(&one, 1, &shown, 1, NULL, index, INDEX_BYTES, scratch,
                                                  SCRATCH_BYTES, &inside, NULL));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_open_scene(index, INDEX_BYTES, &shown, 1, &inside));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_refit_scene(&one, 1, &shown, 1, index, INDEX_BYTES, &inside, NULL));
    CHECK(bytes == 7);
}

/* A scene without instances takes no views: to ask for their size opens it. */
static void a_scene_of_nothing_takes_no_views(void)
{
    const hgrid_ray_f64 ray = {{0.3, 0.4, 50}, {0, 0, -1}, 0, INFINITY, 0};
    hgrid_scene empty, view = HGRID_SCENE_INIT;
    uint64_t bytes = 0, of_views = 7;
    EXPECT(HGRID_OK, hgrid_build_scene(NULL, 0, objects, 3, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &empty, NULL));
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack_scene(&empty, NULL, 0, &bytes));
    void *const packed = guarded((size_t)bytes);
    EXPECT(HGRID_OK, hgrid_pack_scene(&empty, packed, (size_t)bytes, &bytes));
    EXPECT(HGRID_OK, hgrid_open_packed_scene(packed, (size_t)bytes, NULL, 0, NULL, 0, &of_views, &view));
    CHECK(of_views == 0 && !hgrid_occluded_scene(&view, &ray, NULL));
    EXPECT(HGRID_OK, hgrid_validate_scene(&view, scratch, SCRATCH_BYTES));
}

#define REFUSED(parameter, call) \
    do { \
        EXPECT(HGRID_ERROR_NULL_ARGUMENT, call); \
        puts("null " #parameter); \
    } while (0)

static void no_pointers(void)
{
    void *const at = file, *const room = views;
    const size_t n = file_bytes, m = view_bytes;
    uint64_t bytes;
    hgrid_scene view;
    const hgrid_ray_f64 ray = {{0.3, 0.4, 50}, {0, 0, -1}, 0, INFINITY, 0};
    hgrid_scene_hit hit, miss = {INFINITY, 0, 0, HGRID_INVALID_ID, {99, 0, 0, 0}};
    hgrid_instance instance;
    hgrid_grid found;
    CHECK(hgrid_intersect_scene(&opened, &ray, NULL, &hit));
    CHECK(!hgrid_scene_locate(&opened, &miss, &instance, &found));
    CHECK(!hgrid_scene_locate(NULL, &hit, &instance, &found));
    puts("null hgrid_scene_locate.scene");
    CHECK(!hgrid_scene_locate(&opened, NULL, &instance, &found));
    puts("null hgrid_scene_locate.hit");
    CHECK(hgrid_scene_locate(&opened, &hit, NULL, &found));
    puts("null hgrid_scene_locate.instance");
    CHECK(hgrid_scene_locate(&opened, &hit, &instance, NULL));
    puts("null hgrid_scene_locate.grid");
    CHECK(!hgrid_scene_instance(&opened, &miss, 0, &instance));
    CHECK(!hgrid_scene_instance(NULL, &hit, 0, &instance));
    puts("null hgrid_scene_instance.scene");
    CHECK(!hgrid_scene_instance(&opened, NULL, 0, &instance));
    puts("null hgrid_scene_instance.hit");
    CHECK(!hgrid_scene_instance(&opened, &hit, 0, NULL));
    puts("null hgrid_scene_instance.instance");
    REFUSED(hgrid_pack_scene.scene, hgrid_pack_scene(NULL, at, n, &bytes));
    REFUSED(hgrid_pack_scene.to, hgrid_pack_scene(&scene, NULL, n, &bytes));
    REFUSED(hgrid_pack_scene.bytes, hgrid_pack_scene(&scene, at, n, NULL));
    REFUSED(hgrid_open_packed_scene.blob, hgrid_open_packed_scene(NULL, n, room, m, NULL, 0, &bytes, &view));
    REFUSED(hgrid_open_packed_scene.views, hgrid_open_packed_scene(at, n, NULL, m, NULL, 0, &bytes, &view));
    REFUSED(hgrid_open_packed_scene.scratch, hgrid_open_packed_scene(at, n, room, m, NULL, 4, &bytes, &view));
    REFUSED(hgrid_open_packed_scene.bytes, hgrid_open_packed_scene(at, n, room, m, NULL, 0, NULL, &view));
    REFUSED(hgrid_open_packed_scene.scene, hgrid_open_packed_scene(at, n, room, m, NULL, 0, &bytes, NULL));
}

int main(void)
{
    prepare();
    a_packed_scene_needs_nothing_else();
    what_is_refused();
    lost_views_are_refused();
    a_scene_of_nothing_takes_no_views();
    no_pointers();
    return 0;
}
