/* Shapes of the caller and scenes of instances: refusals, NULL in every pointer, structs of other versions. */

#include "scenes.h"

static const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;

/* Checks that a build of shapes is refused. */
static uint32_t no_shapes(hgrid_status expected, const hgrid_boxes *of, const hgrid_config *config, void *index,
                          size_t index_bytes, void *extra, size_t extra_bytes)
{
    hgrid_shapes view;
    hgrid_report report = new_report;
    memset(&view, 0xc7, sizeof view);
    EXPECT_OF("hgrid_build_shapes(", expected,
              hgrid_build_shapes(of, config, index, index_bytes, extra, extra_bytes, &view, &report));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    return report.triangle;
}

/* Checks that a build of a scene is refused. */
static uint32_t no_scene(hgrid_status expected, const hgrid_instance *of, size_t count, size_t object_count,
                         const hgrid_config *config, void *index, size_t index_bytes, void *extra,
                         size_t extra_bytes)
{
    hgrid_scene view;
    hgrid_report report = new_report;
    memset(&view, 0xc7, sizeof view);
    EXPECT_OF("hgrid_build_scene(", expected,
              hgrid_build_scene(of, count, objects, object_count, config, index, index_bytes, extra, extra_bytes,
                                &view, &report));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    return report.triangle;
}

static void what_shapes_refuse(void)
{
    char *const index = (char *)index_region, *const extra = (char *)scratch;
    hgrid_boxes bad = boxes;
    bad.box_stride = 23;
    no_shapes(HGRID_ERROR_INVALID_POSITIONS, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.mask_stride = 3;
    no_shapes(HGRID_ERROR_INVALID_MASKS, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.reserved = 1;
    no_shapes(HGRID_ERROR_STRUCT_SIZE, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.boxes = NULL;
    no_shapes(HGRID_ERROR_NULL_ARGUMENT, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.boxes = index;
    no_shapes(HGRID_ERROR_OVERLAP, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.masks = NULL, bad.count = 4294967295u;
    no_shapes(HGRID_ERROR_TOO_MANY_TRIANGLES, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_INVALID_METHOD, &boxes, &one_level, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_MISALIGNED, &boxes, NULL, index + 8, INDEX_BYTES - 64, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_INDEX_TOO_SMALL, &boxes, NULL, index, 640, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_SCRATCH_TOO_SMALL, &boxes, NULL, index, INDEX_BYTES, extra, 64);

    /* A box that is not finite is left out, or named in strict mode. */
    static sphere broken[SPHERES];
    hgrid_config strict = HGRID_CONFIG_INIT;
    hgrid_report report = new_report;
    hgrid_shapes view;
    memcpy(broken, spheres, sizeof broken);
    broken[7].box[3] = NAN;
    bad = boxes, bad.boxes = broken;
    strict.flags = HGRID_BUILD_STRICT;
    CHECK(no_shapes(HGRID_ERROR_NON_FINITE, &bad, &strict, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 7);
    EXPECT(HGRID_OK,
           hgrid_build_shapes(&bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES, &view, &report));
    CHECK(report.skipped_count == 1 && report.reference_count == SPHERES - 1);

    /* Blobs of other content. */
    hgrid_grid none;
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open_shapes(scene_blob, scene_bytes, &boxes, &view));
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open(shape_blob, shape_bytes, &mesh, &none));
    EXPECT(HGRID_OK, hgrid_peek(scene_blob, scene_bytes, &info));
    CHECK(info.total_bytes == scene_bytes && info.triangle_count == 2);
    bad = boxes, bad.box_stride = 23;
    EXPECT(HGRID_ERROR_INVALID_POSITIONS, hgrid_open_shapes(shape_blob, shape_bytes, &bad, &view));
    bad = boxes, bad.mask_stride = 3;
    EXPECT(HGRID_ERROR_INVALID_MASKS, hgrid_open_shapes(shape_blob, shape_bytes, &bad, &view));
    bad = boxes, bad.count--;
    EXPECT(HGRID_ERROR_MESH_MISMATCH, hgrid_open_shapes(shape_blob, shape_bytes, &bad, &view));
    EXPECT(HGRID_ERROR_MESH_MISMATCH, hgrid_refit_shapes(&bad, shape_blob, shape_bytes, &view, NULL));
    EXPECT(HGRID_ERROR_TRUNCATED, hgrid_open_shapes(shape_blob, shape_bytes - 1, &boxes, &view));

    /* A view of zeros. */
    const hgrid_shapes zeros = HGRID_SHAPES_INIT;
    const hgrid_ray ray = {{0.5f, 0.5f, -1}, 0, {0, 0, 1}, INFINITY};
    hgrid_hit hit;
    hgrid_object object;
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_validate_shapes(&zeros, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_object_shapes(&zeros, &object));
    CHECK(!hgrid_intersect_shapes(&zeros, &ray, NULL, &hit) && !hgrid_occluded_shapes(&zeros, &ray, NULL));

    /* A damaged tree does not validate. */
    void *copy = guarded_copy(shape_blob, shape_bytes);
    ((unsigned char *)copy)[shape_bytes - 65] ^= 0x5a;
    ((unsigned char *)copy)[200] ^= 0x5a;
    EXPECT(HGRID_OK, hgrid_open_shapes(copy, shape_bytes, &boxes, &view));
    EXPECT(HGRID_ERROR_CORRUPT, hgrid_validate_shapes(&view, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_shapes(&view, copy, 64));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_shapes(&view, (void *)(uintptr_t)boxes.boxes, 4));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_shapes(&view, (void *)(uintptr_t)boxes.masks, 4));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_shapes(&view, &view, sizeof view));
}

static void what_scenes_refuse(void)
{
    char *const index = (char *)index_region, *const extra = (char *)scratch;
    const hgrid_instance here = HGRID_INSTANCE_INIT;
    hgrid_instance three[3] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    hgrid_report report = new_report;
    three[1].object = 3;
    CHECK(no_scene(HGRID_ERROR_INSTANCE_OBJECT, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 1);
    three[1] = here;
    const float odd[] = {0, NAN, INFINITY, 1e-40f};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        three[2].linear[1][1] = odd[i];
        CHECK(no_scene(HGRID_ERROR_INSTANCE_MATRIX, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES)
              == 2);
    }
    /* A matrix of rank two, and a place that is not a number. */
    const hgrid_instance flat = {{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}, 0, {0, 0, 0}, 1, 0};
    three[2] = flat;
    CHECK(no_scene(HGRID_ERROR_INSTANCE_MATRIX, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 2);
    three[2] = here, three[2].translation[0] = (double)NAN;
    CHECK(no_scene(HGRID_ERROR_INSTANCE_MATRIX, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 2);
    three[2] = here;
    no_scene(HGRID_ERROR_INVALID_METHOD, three, 3, 3, &one_level, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    EXPECT(HGRID_ERROR_INVALID_METHOD, hgrid_scene_bound(3, &one_level, &report));
    EXPECT(HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_scene_bound(SIZE_MAX, NULL, &report));
    no_scene(HGRID_ERROR_TOO_MANY_TRIANGLES, three, SIZE_MAX / 2, 3, NULL, index, INDEX_BYTES, extra,
             SCRATCH_BYTES);
    no_scene(HGRID_ERROR_NULL_ARGUMENT, NULL, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_MISALIGNED, three, 3, 3, NULL, index + 8, INDEX_BYTES - 64, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_INDEX_TOO_SMALL, three, 3, 3, NULL, index, 640, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_SCRATCH_TOO_SMALL, three, 3, 3, NULL, index, INDEX_BYTES, extra, 0);
    no_scene(HGRID_ERROR_OVERLAP, (const hgrid_instance *)index, 3, 3, NULL, index, INDEX_BYTES, extra,
             SCRATCH_BYTES);
    /* Nor may a region lie over an object's blob or view. */
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 3, NULL, shape_blob, shape_bytes, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 3, NULL, index, INDEX_BYTES, inner_blob, inner_bytes);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 3, NULL, index, INDEX_BYTES, &inner, sizeof inner);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 1, NULL, index, INDEX_BYTES, &grid, sizeof grid);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 1, NULL, index, INDEX_BYTES, &mesh_data, sizeof mesh_data);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 2, NULL, index, INDEX_BYTES, &shapes, sizeof shapes);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 2, NULL, index, INDEX_BYTES, spheres, sizeof spheres);
    no_scene(HGRID_ERROR_OVERLAP, three, 3, 1, NULL, index, INDEX_BYTES, objects, sizeof *objects);

    /* A scene may have no instances, and instances of nothing. */
    hgrid_scene empty;
    hgrid_scene_hit hit;
    const hgrid_ray_f64 ray = wide_ray(0.5, 0.5, 1);
    const hgrid_object nothing[2] = {HGRID_OBJECT_INIT, HGRID_OBJECT_INIT};
    uint64_t packed_bytes;
    EXPECT(HGRID_OK, hgrid_build_scene(three, 3, nothing, 2, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES, &empty,
                                       NULL));
    CHECK(!hgrid_intersect_scene(&empty, &ray, NULL, &hit));
    void *packed = guarded(4096);
    EXPECT(HGRID_OK, hgrid_pack_scene(&empty, packed, 4096, &packed_bytes));
    EXPECT(HGRID_OK, hgrid_build_scene(NULL, 0, NULL, 0, NULL, index, HGRID_SCENE_BOUND(0), extra, SCRATCH_BYTES,
                                       &empty, NULL));
    CHECK(!hgrid_intersect_scene(&empty, &ray, NULL, &hit));

    /* Four scenes may be nested, and no more. */
    hgrid_object around[4];
    hgrid_scene nested[4];
    EXPECT(HGRID_OK, hgrid_object_scene(&inner, &around[0]));
    for (int level = 0; level < 3; level++) {
        void *blob = guarded(1024);
        EXPECT(HGRID_OK, hgrid_build_scene(&here, 1, &around[level], 1, NULL, blob, HGRID_SCENE_BOUND(1), extra,
                                           SCRATCH_BYTES, &nested[level], NULL));
        EXPECT(HGRID_OK, hgrid_object_scene(&nested[level], &around[level + 1]));
    }
    hgrid_ray_f64 up = wide_ray(0.3, 0.4, -1);
    up.direction[2] = 1;
    CHECK(hgrid_intersect_scene(&nested[2], &up, NULL, &hit) && hit.path[3] == 0);
    EXPECT(HGRID_ERROR_TOO_DEEP, hgrid_build_scene(&here, 1, &around[3], 1, NULL, index, INDEX_BYTES, extra,
                                                   SCRATCH_BYTES, &empty, NULL));
    EXPECT(HGRID_ERROR_TOO_DEEP, hgrid_open_scene(scene_blob, scene_bytes, around, 4, &empty));

    EXPECT(HGRID_ERROR_MISSING_OBJECTS, hgrid_open_scene(scene_blob, scene_bytes, objects, 2, &empty));
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open_scene(shape_blob, shape_bytes, objects, 3, &empty));
    EXPECT(HGRID_ERROR_TRUNCATED, hgrid_open_scene(scene_blob, scene_bytes - 1, objects, 3, &empty));
    void *copy = guarded_copy(inner_blob, inner_bytes);
    EXPECT(HGRID_ERROR_MESH_MISMATCH,
           hgrid_refit_scene(instances, INSTANCES - 1, objects, 2, copy, inner_bytes, &empty, NULL));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_refit_scene((const hgrid_instance *)copy, INSTANCES, objects, 2, copy,
                                                  inner_bytes, &empty, NULL));
    EXPECT(HGRID_ERROR_OVERLAP,
           hgrid_refit_scene(instances, INSTANCES, objects, 3, inner_blob, inner_bytes, &empty, NULL));
    hgrid_refit_report refit = HGRID_REFIT_REPORT_INIT;
    instances[3].object = 9;
    EXPECT(HGRID_ERROR_INSTANCE_OBJECT,
           hgrid_refit_scene(instances, INSTANCES, objects, 2, copy, inner_bytes, &empty, &refit));
    CHECK(refit.triangle == 3);
    refit.triangle = 0;
    instances[3].object = 1, instances[3].linear[0][0] = 0;
    copy = guarded_copy(inner_blob, inner_bytes);
    EXPECT(HGRID_ERROR_INSTANCE_MATRIX,
           hgrid_refit_scene(instances, INSTANCES, objects, 2, copy, inner_bytes, &empty, &refit));
    CHECK(refit.triangle == 3);
    instances[3].linear[0][0] = 1;

    /* Boxes that are not those of the instances. */
    copy = guarded_copy(inner_blob, inner_bytes);
    /* Move the last instance, which lies before the padding of its section. */
    const double elsewhere = 1234;
    memcpy((char *)copy + inner_bytes - 16 - 72 + 40, &elsewhere, sizeof elsewhere);
    EXPECT(HGRID_OK, hgrid_open_scene(copy, inner_bytes, objects, 2, &empty));
    EXPECT(HGRID_ERROR_CORRUPT, hgrid_validate_scene(&empty, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_scene(&empty, copy, 64));

    const hgrid_scene zeros = HGRID_SCENE_INIT;
    const hgrid_grid no_grid = HGRID_GRID_INIT;
    hgrid_object object;
    float normal[3];
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_validate_scene(&zeros, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_object_scene(&zeros, &object));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_object_grid(&no_grid, &object));
    CHECK(!hgrid_intersect_scene(&zeros, &ray, NULL, &hit) && !hgrid_occluded_scene(&zeros, &ray, NULL));
    hgrid_instance instance;
    CHECK(!hgrid_scene_normal(&zeros, &hit, NULL, normal));
    CHECK(!hgrid_scene_instance(&zeros, &hit, 0, &instance));
    CHECK(!hgrid_scene_locate(&zeros, &hit, &instance, NULL));
    hgrid_scene_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID, {99, 0, 0, 0}};
    CHECK(!hgrid_scene_normal(&scene, &miss, NULL, normal));
    hgrid_scene_surface surface;
    CHECK(!hgrid_scene_surface_at(&zeros, &ray, &hit, &surface));
    CHECK(!hgrid_scene_surface_at(&scene, &ray, &miss, &surface));
}

/* The arguments of both batch functions. */
typedef struct {
    const hgrid_scene *scene;
    const hgrid_ray_f64 *rays;
    size_t ray_stride;
    void *answers;
    size_t hit_stride, occluded_stride, count;
    hgrid_coherence coherence;
    const hgrid_scene_options *options;
} batch;

enum { MANY = 10 };

static hgrid_ray_f64 many_rays[MANY];
static unsigned char many_answers[32 * MANY];

static batch good_batch(void)
{
    const batch b = {&scene, many_rays, 0, many_answers, 0, 0, MANY, HGRID_COHERENCE_COHERENT, NULL};
    return b;
}

/* Checks that both batch functions refuse the arguments and write nothing. */
static void no_batch(hgrid_status expected, batch b)
{
    memset(many_answers, 0xc7, sizeof many_answers);
    EXPECT(expected, hgrid_intersect_scene_n(b.scene, b.rays, b.ray_stride, (hgrid_scene_hit *)b.answers, b.hit_stride,
                                             b.count, b.coherence, b.options));
    EXPECT(expected, hgrid_occluded_scene_n(b.scene, b.rays, b.ray_stride, (uint8_t *)b.answers, b.occluded_stride,
                                            b.count, b.coherence, b.options));
    CHECK(all_bytes_are(many_answers, sizeof many_answers, 0xc7));
}

static void what_batches_refuse(void)
{
    const hgrid_scene zeros = HGRID_SCENE_INIT;
    hgrid_scene_options options = HGRID_SCENE_OPTIONS_INIT;
    batch b = good_batch();
    for (int i = 0; i < MANY; i++)
        many_rays[i] = wide_ray(0.1 * i, 0.5, 1);
    b.scene = &zeros;
    no_batch(HGRID_ERROR_NOT_A_GRID, b);

    const hgrid_coherence coherences[] = {2, 0x80000000u, UINT32_MAX};
    for (int i = 0; i < 3; i++) {
        b = good_batch(), b.coherence = coherences[i];
        no_batch(HGRID_ERROR_INVALID_COHERENCE, b);
        b.count = 0;
        no_batch(HGRID_ERROR_INVALID_COHERENCE, b);
    }

    /* A stride for rays in float is too small; and the largest strides reach past the end of memory. */
    const size_t strides[] = {1, sizeof(hgrid_ray), sizeof(hgrid_ray_f64) - 1, SIZE_MAX, SIZE_MAX / 9};
    for (int i = 0; i < 5; i++) {
        b = good_batch(), b.ray_stride = strides[i];
        no_batch(HGRID_ERROR_INVALID_RAYS, b);
        if (i < 3)
            b.count = 0, no_batch(HGRID_ERROR_INVALID_RAYS, b);
        else
            b = good_batch(), b.hit_stride = b.occluded_stride = strides[i], no_batch(HGRID_ERROR_INVALID_ANSWERS, b);
    }
    b = good_batch(), b.count = SIZE_MAX / 64 + 1;
    no_batch(HGRID_ERROR_INVALID_RAYS, b);
    for (size_t stride = 1; stride < sizeof(hgrid_scene_hit); stride++)
        EXPECT(HGRID_ERROR_INVALID_ANSWERS,
               hgrid_intersect_scene_n(&scene, many_rays, 0, (hgrid_scene_hit *)(void *)many_answers, stride, 1,
                                       HGRID_COHERENCE_COHERENT, NULL));

    b = good_batch(), b.options = &options;
    options.struct_size--;
    no_batch(HGRID_ERROR_STRUCT_SIZE, b);
    options.struct_size++, options.cull = 3;
    no_batch(HGRID_ERROR_INVALID_CULL, b);
    options.cull = HGRID_CULL_NONE;

    /* Answers that overlap the rays. */
    b.answers = &many_rays[MANY - 1].reserved;
    no_batch(HGRID_ERROR_OVERLAP, b);

    /* Scratch that overlaps what the call reads or writes: of the scene, of the scene that it shows, and of
     * the objects of that. */
    hgrid_scene *const view = &inner;
    struct {
        void *scratch;
        size_t bytes;
    } cases[] = {{&many_rays[3], 1},          {many_answers + 32 * (MANY - 1), 1},
                 {scene_blob, scene_bytes},   {objects, 1},
                 {inner_blob, 64},            {view, sizeof *view},
                 {shape_blob, shape_bytes},   {&spheres[7], 4},
                 {&spheres[7].mask, 4},       {&shapes, sizeof shapes},
                 {mesh_data.positions, 4},    {mesh_data.indices, 400},
                 {&grid, sizeof grid},         {&scene, sizeof scene}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (hgrid_coherence c = 0; c < 2; c++) {
            b = good_batch(), b.coherence = c, b.options = &options;
            b.hit_stride = sizeof(hgrid_scene_hit), b.occluded_stride = sizeof(hgrid_scene_hit);
            options.scratch = cases[i].scratch, options.scratch_bytes = cases[i].bytes;
            no_batch(HGRID_ERROR_OVERLAP, b);
            /* Without bytes it overlaps nothing; and queries of one ray do not read it. */
            CHECK(hgrid_occluded_scene(&scene, &many_rays[3], &options) ==
                  hgrid_occluded_scene(&scene, &many_rays[3], NULL));
            options.scratch_bytes = 0;
            EXPECT(HGRID_OK, hgrid_occluded_scene_n(&scene, many_rays, 0, many_answers, 0, MANY, c, &options));
        }
    b = good_batch(), b.options = &options;
    options.scratch = NULL, options.scratch_bytes = 16;
    no_batch(HGRID_ERROR_NULL_ARGUMENT, b);
}

/* Checks that both batch functions of shapes refuse the arguments and write nothing. */
static void no_shape_batch(hgrid_status expected, const hgrid_shapes *of, size_t ray_stride, size_t hit_stride,
                           hgrid_coherence how, const hgrid_query_options *options)
{
    static hgrid_ray from[MANY];
    memset(many_answers, 0xc7, sizeof many_answers);
    EXPECT(expected, hgrid_intersect_shapes_n(of, from, ray_stride, (hgrid_hit *)(void *)many_answers, hit_stride, MANY,
                                              how, options));
    EXPECT(expected,
           hgrid_occluded_shapes_n(of, from, ray_stride, many_answers, hit_stride == 1 ? SIZE_MAX : hit_stride, MANY,
                                   how, options));
    CHECK(all_bytes_are(many_answers, sizeof many_answers, 0xc7));
}

static void what_batches_of_shapes_refuse(void)
{
    const hgrid_coherence how = HGRID_COHERENCE_INCOHERENT;
    const hgrid_shapes zeros = HGRID_SHAPES_INIT;
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    no_shape_batch(HGRID_ERROR_NOT_A_GRID, &zeros, 0, 0, how, NULL);
    no_shape_batch(HGRID_ERROR_INVALID_COHERENCE, &shapes, 0, 0, 2, NULL);
    no_shape_batch(HGRID_ERROR_INVALID_RAYS, &shapes, sizeof(hgrid_ray) - 1, 0, how, NULL);
    no_shape_batch(HGRID_ERROR_INVALID_ANSWERS, &shapes, 0, 1, how, NULL);
    options.struct_size--;
    no_shape_batch(HGRID_ERROR_STRUCT_SIZE, &shapes, 0, 0, how, &options);
    options.struct_size++;
    /* Scratch that overlaps what the call reads or writes. */
    struct {
        void *scratch;
        size_t bytes;
    } cases[] = {{many_answers, 1},
                 {shape_blob, 64},
                 {&spheres[7], 4},
                 {&spheres[7].mask, 4},
                 {&shapes, sizeof shapes}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        options.scratch = cases[i].scratch, options.scratch_bytes = cases[i].bytes;
        no_shape_batch(HGRID_ERROR_OVERLAP, &shapes, 0, 0, how, &options);
    }
    options.scratch = NULL, options.scratch_bytes = 16;
    no_shape_batch(HGRID_ERROR_NULL_ARGUMENT, &shapes, 0, 0, how, &options);
}

/* A call with NULL for a parameter: refused, allowed, or a miss. */
#define REFUSED(parameter, call) \
    do { \
        EXPECT(HGRID_ERROR_NULL_ARGUMENT, call); \
        puts("null " #parameter); \
    } while (0)
#define ALLOWED(parameter, call) \
    do { \
        EXPECT(HGRID_OK, call); \
        puts("null " #parameter); \
    } while (0)
#define MISSED(parameter, call) \
    do { \
        CHECK(!(call)); \
        puts("null " #parameter); \
    } while (0)

static void no_pointers(void)
{
    void *const x = index_region, *const y = scratch, *const b = shape_blob, *const c = inner_blob;
    const size_t n = INDEX_BYTES, m = SCRATCH_BYTES, s = shape_bytes, t = inner_bytes, k = INSTANCES;
    hgrid_shapes view;
    hgrid_scene sight;
    hgrid_object object;
    hgrid_report report = new_report;
    hgrid_hit hit;
    hgrid_scene_hit scene_hit;
    const hgrid_ray ray = {{0.5f, 0.5f, -1}, 0, {0, 0, 1}, INFINITY};
    hgrid_ray_f64 wide = wide_ray(0.3, 0.4, -1);
    float normal[3];
    wide.direction[2] = 1;
    CHECK(hgrid_intersect_scene(&inner, &wide, NULL, &scene_hit));
    REFUSED(hgrid_build_shapes.boxes, hgrid_build_shapes(NULL, NULL, x, n, y, m, &view, NULL));
    ALLOWED(hgrid_build_shapes.config, hgrid_build_shapes(&boxes, NULL, x, n, y, m, &view, &report));
    REFUSED(hgrid_build_shapes.index, hgrid_build_shapes(&boxes, NULL, NULL, n, y, m, &view, NULL));
    REFUSED(hgrid_build_shapes.scratch, hgrid_build_shapes(&boxes, NULL, x, n, NULL, m, &view, NULL));
    REFUSED(hgrid_build_shapes.shapes, hgrid_build_shapes(&boxes, NULL, x, n, y, m, NULL, NULL));
    ALLOWED(hgrid_build_shapes.report, hgrid_build_shapes(&boxes, NULL, x, n, y, m, &view, NULL));
    REFUSED(hgrid_open_shapes.blob, hgrid_open_shapes(NULL, s, &boxes, &view));
    REFUSED(hgrid_open_shapes.boxes, hgrid_open_shapes(b, s, NULL, &view));
    REFUSED(hgrid_open_shapes.shapes, hgrid_open_shapes(b, s, &boxes, NULL));
    REFUSED(hgrid_refit_shapes.boxes, hgrid_refit_shapes(NULL, b, s, &view, NULL));
    REFUSED(hgrid_refit_shapes.blob, hgrid_refit_shapes(&boxes, NULL, s, &view, NULL));
    REFUSED(hgrid_refit_shapes.shapes, hgrid_refit_shapes(&boxes, b, s, NULL, NULL));
    ALLOWED(hgrid_refit_shapes.report, hgrid_refit_shapes(&boxes, b, s, &view, NULL));
    REFUSED(hgrid_validate_shapes.shapes, hgrid_validate_shapes(NULL, y, m));
    REFUSED(hgrid_validate_shapes.scratch, hgrid_validate_shapes(&shapes, NULL, m));
    MISSED(hgrid_intersect_shapes.shapes, hgrid_intersect_shapes(NULL, &ray, NULL, &hit));
    MISSED(hgrid_intersect_shapes.ray, hgrid_intersect_shapes(&shapes, NULL, NULL, &hit));
    MISSED(hgrid_intersect_shapes.hit, hgrid_intersect_shapes(&shapes, &ray, NULL, NULL));
    CHECK(hgrid_intersect_shapes(&shapes, &ray, NULL, &hit) == hgrid_occluded_shapes(&shapes, &ray, NULL));
    puts("null hgrid_intersect_shapes.options");
    puts("null hgrid_occluded_shapes.options");
    MISSED(hgrid_occluded_shapes.shapes, hgrid_occluded_shapes(NULL, &ray, NULL));
    MISSED(hgrid_occluded_shapes.ray, hgrid_occluded_shapes(&shapes, NULL, NULL));
    const size_t each = 1;
    const hgrid_coherence taken = HGRID_COHERENCE_COHERENT;
    uint8_t is_dark;
    REFUSED(hgrid_intersect_shapes_n.shapes, hgrid_intersect_shapes_n(NULL, &ray, 0, &hit, 0, each, taken, NULL));
    REFUSED(hgrid_intersect_shapes_n.rays, hgrid_intersect_shapes_n(&shapes, NULL, 0, &hit, 0, each, taken, NULL));
    REFUSED(hgrid_intersect_shapes_n.hits, hgrid_intersect_shapes_n(&shapes, &ray, 0, NULL, 0, each, taken, NULL));
    ALLOWED(hgrid_intersect_shapes_n.rays, hgrid_intersect_shapes_n(&shapes, NULL, 0, NULL, 0, 0, taken, NULL));
    ALLOWED(hgrid_intersect_shapes_n.options, hgrid_intersect_shapes_n(&shapes, &ray, 0, &hit, 0, each, taken, NULL));
    REFUSED(hgrid_occluded_shapes_n.shapes, hgrid_occluded_shapes_n(NULL, &ray, 0, &is_dark, 0, each, taken, NULL));
    REFUSED(hgrid_occluded_shapes_n.rays, hgrid_occluded_shapes_n(&shapes, NULL, 0, &is_dark, 0, each, taken, NULL));
    REFUSED(hgrid_occluded_shapes_n.occluded, hgrid_occluded_shapes_n(&shapes, &ray, 0, NULL, 0, each, taken, NULL));
    ALLOWED(hgrid_occluded_shapes_n.rays, hgrid_occluded_shapes_n(&shapes, NULL, 0, NULL, 0, 0, taken, NULL));
    ALLOWED(hgrid_occluded_shapes_n.options, hgrid_occluded_shapes_n(&shapes, &ray, 0, &is_dark, 0, each, taken, NULL));
    REFUSED(hgrid_object_grid.grid, hgrid_object_grid(NULL, &object));
    REFUSED(hgrid_object_grid.object, hgrid_object_grid(&grid, NULL));
    REFUSED(hgrid_object_shapes.shapes, hgrid_object_shapes(NULL, &object));
    REFUSED(hgrid_object_shapes.object, hgrid_object_shapes(&shapes, NULL));
    REFUSED(hgrid_object_scene.scene, hgrid_object_scene(NULL, &object));
    REFUSED(hgrid_object_scene.object, hgrid_object_scene(&scene, NULL));
    ALLOWED(hgrid_scene_bound.config, hgrid_scene_bound(k, NULL, &report));
    REFUSED(hgrid_scene_bound.report, hgrid_scene_bound(k, NULL, NULL));
    REFUSED(hgrid_build_scene.instances, hgrid_build_scene(NULL, k, objects, 2, NULL, x, n, y, m, &sight, NULL));
    REFUSED(hgrid_build_scene.objects, hgrid_build_scene(instances, k, NULL, 2, NULL, x, n, y, m, &sight, NULL));
    ALLOWED(hgrid_build_scene.config, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, &sight, NULL));
    REFUSED(hgrid_build_scene.index, hgrid_build_scene(instances, k, objects, 2, NULL, NULL, n, y, m, &sight, NULL));
    REFUSED(hgrid_build_scene.scratch, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, NULL, m, &sight, NULL));
    REFUSED(hgrid_build_scene.scene, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, NULL, NULL));
    ALLOWED(hgrid_build_scene.report, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, &sight, NULL));
    REFUSED(hgrid_open_scene.blob, hgrid_open_scene(NULL, t, objects, 2, &sight));
    REFUSED(hgrid_open_scene.objects, hgrid_open_scene(c, t, NULL, 2, &sight));
    REFUSED(hgrid_open_scene.scene, hgrid_open_scene(c, t, objects, 2, NULL));
    REFUSED(hgrid_refit_scene.instances, hgrid_refit_scene(NULL, k, objects, 2, c, t, &sight, NULL));
    REFUSED(hgrid_refit_scene.objects, hgrid_refit_scene(instances, k, NULL, 2, c, t, &sight, NULL));
    REFUSED(hgrid_refit_scene.blob, hgrid_refit_scene(instances, k, objects, 2, NULL, t, &sight, NULL));
    REFUSED(hgrid_refit_scene.scene, hgrid_refit_scene(instances, k, objects, 2, c, t, NULL, NULL));
    ALLOWED(hgrid_refit_scene.report, hgrid_refit_scene(instances, k, objects, 2, c, t, &sight, NULL));
    REFUSED(hgrid_validate_scene.scene, hgrid_validate_scene(NULL, y, m));
    REFUSED(hgrid_validate_scene.scratch, hgrid_validate_scene(&scene, NULL, m));
    MISSED(hgrid_intersect_scene.scene, hgrid_intersect_scene(NULL, &wide, NULL, &scene_hit));
    MISSED(hgrid_intersect_scene.ray, hgrid_intersect_scene(&inner, NULL, NULL, &scene_hit));
    MISSED(hgrid_intersect_scene.hit, hgrid_intersect_scene(&inner, &wide, NULL, NULL));
    puts("null hgrid_intersect_scene.options");
    puts("null hgrid_occluded_scene.options");
    MISSED(hgrid_occluded_scene.scene, hgrid_occluded_scene(NULL, &wide, NULL));
    MISSED(hgrid_occluded_scene.ray, hgrid_occluded_scene(&inner, NULL, NULL));
    const size_t all = MANY;
    const hgrid_coherence how = HGRID_COHERENCE_COHERENT;
    const hgrid_ray_f64 *const from = many_rays;
    hgrid_scene_hit hits[MANY];
    uint8_t dark[MANY];
    REFUSED(hgrid_intersect_scene_n.scene, hgrid_intersect_scene_n(NULL, from, 0, hits, 0, all, how, NULL));
    REFUSED(hgrid_intersect_scene_n.rays, hgrid_intersect_scene_n(&inner, NULL, 0, hits, 0, all, how, NULL));
    REFUSED(hgrid_intersect_scene_n.hits, hgrid_intersect_scene_n(&inner, from, 0, NULL, 0, all, how, NULL));
    ALLOWED(hgrid_intersect_scene_n.rays, hgrid_intersect_scene_n(&inner, NULL, 0, NULL, 0, 0, how, NULL));
    ALLOWED(hgrid_intersect_scene_n.options, hgrid_intersect_scene_n(&inner, from, 0, hits, 0, all, how, NULL));
    REFUSED(hgrid_occluded_scene_n.scene, hgrid_occluded_scene_n(NULL, from, 0, dark, 0, all, how, NULL));
    REFUSED(hgrid_occluded_scene_n.rays, hgrid_occluded_scene_n(&inner, NULL, 0, dark, 0, all, how, NULL));
    REFUSED(hgrid_occluded_scene_n.occluded, hgrid_occluded_scene_n(&inner, from, 0, NULL, 0, all, how, NULL));
    ALLOWED(hgrid_occluded_scene_n.rays, hgrid_occluded_scene_n(&inner, NULL, 0, NULL, 0, 0, how, NULL));
    ALLOWED(hgrid_occluded_scene_n.options, hgrid_occluded_scene_n(&inner, from, 0, dark, 0, all, how, NULL));
    hgrid_scene_surface at;
    float corners[6];
    MISSED(hgrid_box_of_shapes.shapes, hgrid_box_of_shapes(NULL, corners));
    MISSED(hgrid_box_of_shapes.corners, hgrid_box_of_shapes(&shapes, NULL));
    MISSED(hgrid_box_of_scene.scene, hgrid_box_of_scene(NULL, corners));
    MISSED(hgrid_box_of_scene.corners, hgrid_box_of_scene(&inner, NULL));
    MISSED(hgrid_scene_surface_at.scene, hgrid_scene_surface_at(NULL, &wide, &scene_hit, &at));
    MISSED(hgrid_scene_surface_at.ray, hgrid_scene_surface_at(&inner, NULL, &scene_hit, &at));
    MISSED(hgrid_scene_surface_at.hit, hgrid_scene_surface_at(&inner, &wide, NULL, &at));
    MISSED(hgrid_scene_surface_at.surface, hgrid_scene_surface_at(&inner, &wide, &scene_hit, NULL));
    CHECK(hgrid_scene_surface_at(&inner, &wide, &scene_hit, &at));
    MISSED(hgrid_scene_normal.scene, hgrid_scene_normal(NULL, &scene_hit, NULL, normal));
    MISSED(hgrid_scene_normal.hit, hgrid_scene_normal(&inner, NULL, NULL, normal));
    MISSED(hgrid_scene_normal.normal, hgrid_scene_normal(&inner, &scene_hit, NULL, NULL));
    CHECK(hgrid_scene_normal(&inner, &scene_hit, NULL, normal));
    puts("null hgrid_scene_normal.object_normal");
}

static hgrid_status found(bool is_found)
{
    return is_found ? HGRID_OK : HGRID_ERROR_STRUCT_SIZE;
}

static void structs_of_other_versions(void)
{
    void *const x = index_region, *const y = scratch, *const b = shape_blob, *const c = inner_blob;
    const size_t n = INDEX_BYTES, m = SCRATCH_BYTES, s = shape_bytes, t = inner_bytes, k = INSTANCES;
    const hgrid_config config = HGRID_CONFIG_INIT;
    const hgrid_refit_report refit = HGRID_REFIT_REPORT_INIT;
    const hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_scene_options scene_options = HGRID_SCENE_OPTIONS_INIT;
    const float *const at = spheres[0].center;
    const hgrid_ray ray = {{at[0], at[1], at[2] - 3}, 0, {0, 0, 1}, INFINITY};
    hgrid_ray_f64 wide = wide_ray(0.3, 0.4, -1);
    hgrid_shapes view;
    hgrid_scene sight;
    hgrid_report report = new_report;
    hgrid_hit hit;
    hgrid_scene_hit scene_hit;
    wide.direction[2] = 1;
    CHECK_VERSIONS(hgrid_build_shapes.boxes, hgrid_boxes, boxes,
                   hgrid_build_shapes(it, NULL, x, n, y, m, &view, NULL));
    CHECK_VERSIONS(hgrid_build_shapes.config, hgrid_config, config,
                   hgrid_build_shapes(&boxes, it, x, n, y, m, &view, NULL));
    CHECK_VERSIONS(hgrid_build_shapes.report, hgrid_report, new_report,
                   hgrid_build_shapes(&boxes, NULL, x, n, y, m, &view, it));
    CHECK_VERSIONS(hgrid_open_shapes.boxes, hgrid_boxes, boxes, hgrid_open_shapes(b, s, it, &view));
    CHECK_VERSIONS(hgrid_refit_shapes.boxes, hgrid_boxes, boxes, hgrid_refit_shapes(it, b, s, &view, NULL));
    CHECK_VERSIONS(hgrid_refit_shapes.report, hgrid_refit_report, refit,
                   hgrid_refit_shapes(&boxes, b, s, &view, it));
    CHECK_VERSIONS(hgrid_intersect_shapes.options, hgrid_query_options, options,
                   found(hgrid_intersect_shapes(&shapes, &ray, it, &hit)));
    CHECK_VERSIONS(hgrid_occluded_shapes.options, hgrid_query_options, options,
                   found(hgrid_occluded_shapes(&shapes, &ray, it)));
    CHECK_VERSIONS(hgrid_scene_bound.config, hgrid_config, config, hgrid_scene_bound(5, it, &report));
    CHECK_VERSIONS(hgrid_scene_bound.report, hgrid_report, new_report, hgrid_scene_bound(5, NULL, it));
    CHECK_VERSIONS(hgrid_build_scene.config, hgrid_config, config,
                   hgrid_build_scene(instances, k, objects, 2, it, x, n, y, m, &sight, NULL));
    CHECK_VERSIONS(hgrid_build_scene.report, hgrid_report, new_report,
                   hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, &sight, it));
    CHECK_VERSIONS(hgrid_refit_scene.report, hgrid_refit_report, refit,
                   hgrid_refit_scene(instances, k, objects, 2, c, t, &sight, it));
    CHECK_VERSIONS(hgrid_intersect_scene.options, hgrid_scene_options, scene_options,
                   found(hgrid_intersect_scene(&inner, &wide, it, &scene_hit)));
    CHECK_VERSIONS(hgrid_occluded_scene.options, hgrid_scene_options, scene_options,
                   found(hgrid_occluded_scene(&inner, &wide, it)));
    const hgrid_coherence how = HGRID_COHERENCE_INCOHERENT;
    uint8_t dark;
    CHECK_VERSIONS(hgrid_intersect_scene_n.options, hgrid_scene_options, scene_options,
                   hgrid_intersect_scene_n(&inner, &wide, 0, &scene_hit, 0, 1, how, it));
    CHECK_VERSIONS(hgrid_occluded_scene_n.options, hgrid_scene_options, scene_options,
                   hgrid_occluded_scene_n(&inner, &wide, 0, &dark, 0, 1, how, it));
    CHECK_VERSIONS(hgrid_intersect_shapes_n.options, hgrid_query_options, options,
                   hgrid_intersect_shapes_n(&shapes, &ray, 0, &hit, 0, 1, how, it));
    CHECK_VERSIONS(hgrid_occluded_shapes_n.options, hgrid_query_options, options,
                   hgrid_occluded_shapes_n(&shapes, &ray, 0, &dark, 0, 1, how, it));
}

int main(void)
{
    prepare();
    build_shapes();
    build_inner(INDEX_BYTES, SCRATCH_BYTES);
    build_outer();
    what_shapes_refuse();
    what_scenes_refuse();
    what_batches_refuse();
    what_batches_of_shapes_refuse();
    no_pointers();
    structs_of_other_versions();
    return 0;
}
