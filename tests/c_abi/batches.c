/* Batches answer as single queries do, wherever rays and answers lie, and touch nothing else. */

#include "check.h"

static const hgrid_coherence COHERENCES[] = {HGRID_COHERENCE_INCOHERENT, HGRID_COHERENCE_COHERENT};

/* RAYS fills many chunks of a batch and a part of one; SOME is more than one chunk and less than two. */
enum { RAYS = 1000, SOME = 100 };

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static hgrid_ray rays[RAYS];
/* The answers of single queries: hits as a batch writes them, and whether there is one. */
static hgrid_hit expected[RAYS];
static uint8_t expected_occluded[RAYS];
static hgrid_counters expected_work, expected_occluded_work;

/* Makes tiles of 8 x 8 pixels whose rays fan out, with every kind of odd ray among them. */
static void make_rays(void)
{
    for (int i = 0; i < RAYS; i++) {
        const int tile = i / 64, pixel = i % 64;
        const float x = (float)(tile % 4 * 8 + pixel % 8) / 30 - 0.02f;
        const float y = (float)(tile / 4 * 8 + pixel / 8) / 30 - 0.02f;
        rays[i] = ray_down(x, y);
        rays[i].direction[0] = (float)(i % 9 - 4) / 30;
        rays[i].direction[1] = (float)(i % 11 - 5) / 30;
        switch (i % 41) {
        case 1: rays[i].origin[i % 3] = NAN; break;
        case 2: rays[i].direction[0] = rays[i].direction[1] = rays[i].direction[2] = 0; break;
        case 3: rays[i].direction[i % 3] = INFINITY; break;
        case 4: rays[i].t_max = NAN; break;
        case 5: rays[i].t_min = 2, rays[i].t_max = 1; break;
        case 6: rays[i].t_max = 0.5f; break;
        case 7: rays[i].origin[2] = -1, rays[i].direction[2] = 1; break;
        case 8: rays[i].origin[0] = 9; break;
        case 9: memset(&rays[i], 0xff, sizeof rays[i]); break;
        }
    }
}

static void ask_one_by_one(void)
{
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    memset(&expected_work, 0, sizeof expected_work);
    memset(&expected_occluded_work, 0, sizeof expected_occluded_work);
    size_t hits = 0;
    for (int i = 0; i < RAYS; i++) {
        const hgrid_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID};
        expected[i] = miss;
        options.counters = &expected_work;
        hits += hgrid_intersect(&grid, &rays[i], &options, &expected[i]);
        options.counters = &expected_occluded_work;
        expected_occluded[i] = hgrid_occluded(&grid, &rays[i], &options);
    }
    CHECK(hits > RAYS / 2 && hits < RAYS * 9 / 10);
}

static void check_batch(const void *from, size_t ray_stride, void *hits, size_t hit_stride,
                        size_t count, hgrid_coherence coherence)
{
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, (const hgrid_ray *)from, ray_stride,
                                       (hgrid_hit *)hits, hit_stride, count, coherence, NULL));
    for (size_t i = 0; i < count; i++)
        CHECK(memcmp((unsigned char *)hits + i * hit_stride, &expected[i], sizeof *expected) == 0);
}

static void check_occluded(const void *from, size_t ray_stride, void *occluded, size_t stride,
                           size_t count, hgrid_coherence coherence)
{
    EXPECT(HGRID_OK, hgrid_occluded_n(&grid, (const hgrid_ray *)from, ray_stride,
                                      (uint8_t *)occluded, stride, count, coherence, NULL));
    for (size_t i = 0; i < count; i++)
        CHECK(((uint8_t *)occluded)[i * stride] == expected_occluded[i]);
}

/* Tries every count around the size of a chunk, and all rays. The arrays end at a protected page. */
static void tight_arrays(hgrid_coherence coherence)
{
    const size_t counts[] = {1, 2, 7, 63, 64, 65, 127, 128, 129, RAYS};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        const size_t count = counts[i];
        const void *from = guarded_copy(rays, count * sizeof *rays);
        check_batch(from, sizeof *rays, guarded(count * sizeof *expected), sizeof *expected, count,
                    coherence);
        check_occluded(from, sizeof *rays, guarded(count), 1, count, coherence);
    }
    /* A stride of 0 means contiguous elements. */
    hgrid_hit hits[SOME];
    uint8_t occluded[SOME];
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, rays, 0, hits, 0, SOME, coherence, NULL));
    EXPECT(HGRID_OK, hgrid_occluded_n(&grid, rays, 0, occluded, 0, SOME, coherence, NULL));
    CHECK(memcmp(hits, expected, sizeof hits) == 0);
    CHECK(memcmp(occluded, expected_occluded, sizeof occluded) == 0);
}

/* Uses odd addresses and strides, in memory that ends with the last element's own bytes. */
static void gaps_are_not_touched(hgrid_coherence coherence)
{
    for (size_t extra = 1; extra < 20; extra += 3) {
        const size_t ray_stride = sizeof *rays + extra, hit_stride = sizeof *expected + 2 * extra;
        unsigned char *from = (unsigned char *)guarded((SOME - 1) * ray_stride + sizeof *rays);
        const size_t hit_bytes = (SOME - 1) * hit_stride + sizeof *expected;
        unsigned char *hits = (unsigned char *)guarded(hit_bytes);
        unsigned char *occluded = (unsigned char *)guarded((SOME - 1) * (1 + extra) + 1);
        for (size_t i = 0; i < SOME; i++)
            memcpy(from + i * ray_stride, &rays[i], sizeof *rays);
        check_batch(from, ray_stride, hits, hit_stride, SOME, coherence);
        check_occluded(from, ray_stride, occluded, 1 + extra, SOME, coherence);
        for (size_t i = 0; i + 1 < SOME; i++) {
            CHECK(all_bytes_are(from + i * ray_stride + sizeof *rays, extra, 0xc7));
            CHECK(all_bytes_are(hits + i * hit_stride + sizeof *expected, 2 * extra, 0xc7));
            CHECK(all_bytes_are(occluded + i * (1 + extra) + 1, extra, 0xc7));
        }
    }
}

/* All of a ray in one struct, as renderers keep it. */
typedef struct {
    uint8_t is_occluded;
    uint32_t pixel;
    hgrid_ray ray;
    double weight;
    hgrid_hit hit;
    char tail[5];
} path;

static void rays_and_answers_in_one_struct(hgrid_coherence coherence)
{
    path *paths = (path *)guarded(SOME * sizeof *paths);
    for (size_t i = 0; i < SOME; i++)
        paths[i].ray = rays[i];
    path *before = (path *)guarded_copy(paths, SOME * sizeof *paths);
    check_batch(&paths->ray, sizeof *paths, &paths->hit, sizeof *paths, SOME, coherence);
    check_occluded(&paths->ray, sizeof *paths, &paths->is_occluded, sizeof *paths, SOME, coherence);
    /* Nothing but the answers has changed. */
    for (size_t i = 0; i < SOME; i++) {
        before[i].hit = paths[i].hit;
        before[i].is_occluded = paths[i].is_occluded;
    }
    CHECK(memcmp(before, paths, SOME * sizeof *paths) == 0);

    /* Write each hit into the struct before that of its ray, and the other way round. */
    path *shifted = (path *)guarded_copy(paths, SOME * sizeof *paths);
    check_batch(&shifted->ray, sizeof *paths, &shifted[1].hit, sizeof *paths, SOME - 1, coherence);
    memcpy(shifted, paths, SOME * sizeof *paths);
    for (size_t i = 1; i < SOME; i++)
        shifted[i].ray = rays[i - 1];
    check_batch(&shifted[1].ray, sizeof *paths, &shifted->hit, sizeof *paths, SOME - 1, coherence);
}

/* Puts rays and answers side by side without padding, at any address. */
static void packed_pairs(hgrid_coherence coherence)
{
    for (size_t off = 0; off < 4; off++) {
        const size_t pair = sizeof *rays + sizeof *expected;
        unsigned char *pairs = (unsigned char *)guarded(SOME * pair + off);
        for (size_t i = 0; i < SOME; i++)
            memcpy(pairs + i * pair, &rays[i], sizeof *rays);
        check_batch(pairs, pair, pairs + sizeof *rays, pair, SOME, coherence);
        /* Put the answer before the ray. */
        for (size_t i = 0; i < SOME; i++)
            memcpy(pairs + i * pair + sizeof *expected, &rays[i], sizeof *rays);
        check_batch(pairs + sizeof *expected, pair, pairs, pair, SOME, coherence);
        for (size_t i = 0; i < SOME; i++)
            CHECK(memcmp(pairs + i * pair + sizeof *expected, &rays[i], sizeof *rays) == 0);
    }
}

static void counters_add_up(hgrid_coherence coherence)
{
    hgrid_counters work = {1, 2, 3}, occluded_work = {0, 0, 0};
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    static hgrid_hit hits[RAYS];
    static uint8_t occluded[RAYS];
    options.counters = &work;
    memset(hits, 0xc7, sizeof hits);
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, coherence, &options));
    options.counters = &occluded_work;
    EXPECT(HGRID_OK, hgrid_occluded_n(&grid, rays, 0, occluded, 0, RAYS, coherence, &options));
    CHECK(memcmp(hits, expected, sizeof hits) == 0);
    CHECK(memcmp(occluded, expected_occluded, sizeof occluded) == 0);
    CHECK(work.primitive_tests == expected_work.primitive_tests + 1);
    CHECK(work.cell_steps == expected_work.cell_steps + 2);
    CHECK(work.grid_steps == expected_work.grid_steps + 3);
    CHECK(memcmp(&occluded_work, &expected_occluded_work, sizeof occluded_work) == 0);

    /* Options without counters change nothing. */
    options.counters = NULL;
    memset(hits, 0xc7, sizeof hits);
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, coherence, &options));
    CHECK(memcmp(hits, expected, sizeof hits) == 0);
}

/* Makes rays that start near two points in turn, and go anywhere. */
static void scatter(hgrid_ray *mixed, size_t count)
{
    uint32_t state = 1;
    for (size_t i = 0; i < count; i++) {
        const float corner = i % 2 == 0 ? 0.1f : 0.8f;
        float numbers[4];
        for (int k = 0; k < 4; k++) {
            state = state * 1664525u + 1013904223u;
            numbers[k] = (float)(state >> 8) / 16777216.0f;
        }
        mixed[i] = ray_down(corner + numbers[0] / 20, corner + numbers[1] / 20);
        mixed[i].direction[0] = numbers[2] - 0.5f;
        mixed[i].direction[1] = numbers[3] - 0.5f;
    }
}

/* Scratch of any size and alignment changes no answer, and nothing around it is touched. */
static void scratch_may_be_anything(void)
{
    enum { MIXED = 3000 };
    static hgrid_ray mixed[MIXED];
    static hgrid_hit alone[MIXED], hits[MIXED];
    static uint8_t occluded[MIXED];
    const size_t all = 16 * (size_t)MIXED;
    const size_t sizes[] = {0, 1, 15, 4096, 8191, 8192, 8200, 16 * 1000 + 1, all, all + 77};
    const uint32_t masks[] = {UINT32_MAX, 1};
    scatter(mixed, MIXED);
    for (int m = 0; m < 2; m++) {
        hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
        options.mask = masks[m], options.skip = 5;
        for (size_t i = 0; i < MIXED; i++) {
            const hgrid_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID};
            alone[i] = miss;
            (void)hgrid_intersect(&grid, &mixed[i], &options, &alone[i]);
        }
        for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
            for (size_t off = 0; off < 4; off += 3) {
                /* Let the scratch end at a protected page. */
                unsigned char *room = (unsigned char *)guarded(sizes[s] + off);
                options.scratch = room + off, options.scratch_bytes = sizes[s];
                EXPECT(HGRID_OK, hgrid_intersect_n(&grid, mixed, 0, hits, 0, MIXED,
                                                   HGRID_COHERENCE_INCOHERENT, &options));
                EXPECT(HGRID_OK, hgrid_occluded_n(&grid, mixed, 0, occluded, 0, MIXED,
                                                  HGRID_COHERENCE_INCOHERENT, &options));
                CHECK(memcmp(hits, alone, sizeof hits) == 0);
                for (size_t i = 0; i < MIXED; i++)
                    CHECK(occluded[i] == (alone[i].primitive != HGRID_INVALID_ID));
                CHECK(all_bytes_are(room, off, 0xc7));
            }
    }
}

/* Checks that each occluded ray gets the id of a triangle that it hits, and that gaps stay as they are. */
static void check_occluders(const uint8_t occluded[RAYS], const hgrid_query_options *options,
                            hgrid_coherence coherence)
{
    const size_t stride = 7;
    unsigned char *names = (unsigned char *)guarded((RAYS - 1) * stride + 4);
    hgrid_hit all[TRIANGLES];
    EXPECT(HGRID_OK, hgrid_occluder_n(&grid, rays, 0, (uint32_t *)(void *)names, stride, RAYS,
                                      coherence, options));
    for (size_t ray = 0; ray < RAYS; ray++) {
        const uint32_t alone = hgrid_occluder(&grid, &rays[ray], options);
        uint32_t named;
        size_t count;
        memcpy(&named, names + ray * stride, sizeof named);
        CHECK((named != HGRID_INVALID_ID) == occluded[ray]);
        CHECK((alone != HGRID_INVALID_ID) == occluded[ray]);
        EXPECT(HGRID_OK,
               hgrid_intersect_all(&grid, &rays[ray], options, all, TRIANGLES, &count));
        bool is_there = count == 0, alone_is_there = count == 0;
        for (size_t i = 0; i < count; i++) {
            is_there |= all[i].primitive == named;
            alone_is_there |= all[i].primitive == alone;
        }
        CHECK(is_there && alone_is_there);
        if (ray > 0)
            CHECK(all_bytes_are(names + ray * stride - 3, 3, 0xc7));
    }
}

/* Masks, culling and a triangle to skip work as in single queries. */
static void options_are_for_all_rays(hgrid_coherence coherence)
{
    const uint32_t culls[] = {HGRID_CULL_NONE, HGRID_CULL_BACK, HGRID_CULL_FRONT};
    static hgrid_hit hits[RAYS];
    static uint8_t occluded[RAYS];
    for (int i = 0; i < 6; i++) {
        hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
        options.cull = culls[i % 3], options.mask = i < 3 ? UINT32_MAX : 1;
        options.skip = i % 2 == 0 ? HGRID_INVALID_ID : 7;
        EXPECT(HGRID_OK, hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, coherence, &options));
        EXPECT(HGRID_OK, hgrid_occluded_n(&grid, rays, 0, occluded, 0, RAYS, coherence, &options));
        for (int ray = 0; ray < RAYS; ray++) {
            hgrid_hit hit = {INFINITY, 0, 0, HGRID_INVALID_ID};
            const bool is_hit = hgrid_intersect(&grid, &rays[ray], &options, &hit);
            CHECK(memcmp(&hit, &hits[ray], sizeof hit) == 0 && occluded[ray] == is_hit);
        }
        check_occluders(occluded, &options, coherence);
    }
}

/* Scratch may overlap nothing else that the call uses. */
static void scratch_is_nobody_elses(void)
{
    enum { COUNT = 10 };
    static struct {
        unsigned char before[64];
        hgrid_ray rays[COUNT];
        hgrid_hit hits[COUNT];
        unsigned char behind[64];
    } all;
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    const struct {
        hgrid_status status;
        void *scratch;
        size_t bytes;
    } cases[] = {
        {HGRID_OK, all.before, sizeof all.before},
        {HGRID_OK, all.behind, sizeof all.behind},
        {HGRID_ERROR_OVERLAP, all.before, sizeof all.before + 1},
        {HGRID_ERROR_OVERLAP, &all.rays[3], 1},
        {HGRID_ERROR_OVERLAP, &all.hits[COUNT - 1], sizeof(hgrid_hit) + 3},
        {HGRID_ERROR_OVERLAP, mesh_data.positions, 4},
        {HGRID_ERROR_OVERLAP, mesh_data.indices, 400},
        {HGRID_ERROR_OVERLAP, &grid, 1},
        {HGRID_ERROR_OVERLAP, (char *)(&grid + 1) - 1, 1},
        {HGRID_OK, all.rays, 0},
        {HGRID_OK, NULL, 0},
        {HGRID_ERROR_NULL_ARGUMENT, NULL, 16},
    };
    memcpy(all.rays, rays, sizeof all.rays);
    for (hgrid_coherence c = 0; c < 2; c++)
        for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
            options.scratch = cases[i].scratch, options.scratch_bytes = cases[i].bytes;
            memset(all.hits, 0xc7, sizeof all.hits);
            EXPECT(cases[i].status,
                   hgrid_intersect_n(&grid, all.rays, 0, all.hits, 0, COUNT, c, &options));
            CHECK((cases[i].status == HGRID_OK) !=
                  all_bytes_are(all.hits, sizeof all.hits, 0xc7));
            /* Queries of one ray do not read the scratch fields. */
            CHECK(hgrid_occluded(&grid, &rays[0], &options) == expected_occluded[0]);
        }
}

/* The arguments of the three batch functions. */
typedef struct {
    const hgrid_grid *grid;
    const hgrid_ray *rays;
    size_t ray_stride;
    void *answers;
    size_t hit_stride, occluded_stride, count;
    hgrid_coherence coherence;
    const hgrid_query_options *options;
} call;

static unsigned char memory[8 * 1024];

static call good_call(void)
{
    const call c = {&grid, rays, 0, memory, 0, 0, 10, HGRID_COHERENCE_COHERENT, NULL};
    return c;
}

static void refuse(hgrid_status status, call c)
{
    memset(memory, 0xc7, sizeof memory);
    EXPECT(status, hgrid_intersect_n(c.grid, c.rays, c.ray_stride, (hgrid_hit *)c.answers,
                                     c.hit_stride, c.count, c.coherence, c.options));
    EXPECT(status, hgrid_occluded_n(c.grid, c.rays, c.ray_stride, (uint8_t *)c.answers,
                                    c.occluded_stride, c.count, c.coherence, c.options));
    EXPECT(status, hgrid_occluder_n(c.grid, c.rays, c.ray_stride, (uint32_t *)c.answers,
                                    c.hit_stride, c.count, c.coherence, c.options));
    CHECK(all_bytes_are(memory, sizeof memory, 0xc7));
}

static void misuse_is_refused(void)
{
    call c = good_call();
    c.grid = NULL;
    refuse(HGRID_ERROR_NULL_ARGUMENT, c);
    c = good_call(), c.rays = NULL;
    refuse(HGRID_ERROR_NULL_ARGUMENT, c);
    c = good_call(), c.answers = NULL;
    refuse(HGRID_ERROR_NULL_ARGUMENT, c);

    const hgrid_grid empty = HGRID_GRID_INIT;
    c = good_call(), c.grid = &empty;
    refuse(HGRID_ERROR_NOT_A_GRID, c);

    const uint32_t coherences[] = {2, 100, 0x80000000u, UINT32_MAX};
    for (size_t i = 0; i < sizeof coherences / sizeof *coherences; i++) {
        c = good_call(), c.coherence = coherences[i];
        refuse(HGRID_ERROR_INVALID_COHERENCE, c);
        c.count = 0;
        refuse(HGRID_ERROR_INVALID_COHERENCE, c);
    }

    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    c = good_call(), c.options = &options;
    options.struct_size--;
    refuse(HGRID_ERROR_STRUCT_SIZE, c);
    options.struct_size++, options.cull = 3;
    refuse(HGRID_ERROR_INVALID_CULL, c);
    options.cull = HGRID_CULL_NONE, options.reserved = 1;
    refuse(HGRID_ERROR_STRUCT_SIZE, c);
}

static void impossible_strides_are_refused(void)
{
    const size_t short_strides[] = {1, 16, 31};
    for (size_t i = 0; i < sizeof short_strides / sizeof *short_strides; i++) {
        call c = good_call();
        c.ray_stride = short_strides[i];
        refuse(HGRID_ERROR_INVALID_RAYS, c);
        c.count = 1;
        refuse(HGRID_ERROR_INVALID_RAYS, c);
        c.count = 0;
        refuse(HGRID_ERROR_INVALID_RAYS, c);
    }
    /* The last element would lie past the end of memory. */
    const size_t long_strides[] = {SIZE_MAX, SIZE_MAX / 9, SIZE_MAX / 18 + 1};
    for (size_t i = 0; i < sizeof long_strides / sizeof *long_strides; i++) {
        call c = good_call();
        c.ray_stride = long_strides[i];
        refuse(HGRID_ERROR_INVALID_RAYS, c);
        c = good_call();
        c.hit_stride = c.occluded_stride = long_strides[i];
        refuse(HGRID_ERROR_INVALID_ANSWERS, c);
    }
    call c = good_call();
    c.count = SIZE_MAX;
    refuse(HGRID_ERROR_INVALID_RAYS, c);
    c.count = SIZE_MAX / 64 + 1;
    refuse(HGRID_ERROR_INVALID_RAYS, c);

    memset(memory, 0xc7, sizeof memory);
    for (size_t stride = 1; stride < sizeof(hgrid_hit); stride++)
        EXPECT(HGRID_ERROR_INVALID_ANSWERS,
               hgrid_intersect_n(&grid, rays, 0, (hgrid_hit *)(void *)memory, stride, 1,
                                 HGRID_COHERENCE_COHERENT, NULL));
    CHECK(all_bytes_are(memory, sizeof memory, 0xc7));
}

/* Puts rays in the middle of the memory, and answers `distance` bytes after the first of them. */
static void check_overlap(bool is_refused, ptrdiff_t answer_bytes, size_t ray_stride,
                          size_t answer_stride, ptrdiff_t distance, size_t count)
{
    /* All bytes are zero: invalid rays, which miss. */
    memset(memory, 0, sizeof memory);
    hgrid_ray *from = (hgrid_ray *)(void *)(memory + sizeof memory / 2);
    void *to = (unsigned char *)from + distance;
    const hgrid_coherence coherence = HGRID_COHERENCE_INCOHERENT;
    hgrid_status status;
    if (answer_bytes > 1)
        status = hgrid_intersect_n(&grid, from, ray_stride, (hgrid_hit *)to, answer_stride, count,
                                   coherence, NULL);
    else
        status = hgrid_occluded_n(&grid, from, ray_stride, (uint8_t *)to, answer_stride, count,
                                  coherence, NULL);
    CHECK(status == (is_refused ? HGRID_ERROR_OVERLAP : HGRID_OK));
    if (is_refused)
        CHECK(all_bytes_are(memory, sizeof memory, 0));
}

/* Compares the refusals with a test of every pair of elements. */
static void overlaps_are_refused(void)
{
    enum { COUNT = 5 };
    const ptrdiff_t ray = sizeof(hgrid_ray);
    const ptrdiff_t sizes[] = {sizeof(hgrid_hit), 1};
    for (size_t s = 0; s < 2; s++)
        for (ptrdiff_t stride = ray; stride < ray + 26; stride += s == 0 ? 4 : 1)
            for (ptrdiff_t distance = -7 * stride; distance < 7 * stride; distance++) {
                bool is_refused = false;
                for (ptrdiff_t i = 0; i < COUNT; i++)
                    for (ptrdiff_t j = 0; j < COUNT; j++) {
                        const ptrdiff_t answer = distance + j * stride, from = i * stride;
                        is_refused |= answer < from + ray && from < answer + sizes[s];
                    }
                check_overlap(is_refused, sizes[s], (size_t)stride, (size_t)stride, distance,
                              COUNT);
            }
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_intersect_n(&grid, rays, 0, (hgrid_hit *)(void *)rays, 0, 1,
                                                  HGRID_COHERENCE_COHERENT, NULL));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_occluder_n(&grid, rays, 0, (uint32_t *)(void *)rays, 0, 1,
                                                 HGRID_COHERENCE_COHERENT, NULL));

    /* With different strides the arrays may not interleave, even if no elements overlap. */
    check_overlap(true, 16, 64, 16, 0, COUNT);
    check_overlap(true, 16, 64, 128, 32, COUNT);
    check_overlap(true, 16, 128, 64, 32, COUNT);
    check_overlap(false, 16, 64, 16, 4 * 64 + 32, COUNT);
    check_overlap(false, 16, 64, 16, -5 * 16, COUNT);
    check_overlap(true, 16, 64, 16, -5 * 16 + 1, COUNT);
    /* With one ray, strides have no meaning. */
    check_overlap(false, 16, 32, 16, 32, 1);
    check_overlap(true, 16, 32, 16, 31, 1);
    check_overlap(false, 16, 4096, 16, -16, 1);
    check_overlap(true, 16, SIZE_MAX, SIZE_MAX, 16, 1);
    check_overlap(true, 16, SIZE_MAX - 99, SIZE_MAX - 99, -4, 1);
    check_overlap(false, 1, SIZE_MAX, SIZE_MAX, -1, 1);
}

static void no_rays_are_no_error(void)
{
    const hgrid_coherence coherence = HGRID_COHERENCE_INCOHERENT;
    hgrid_counters work = {1, 2, 3};
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    options.counters = &work;
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, NULL, 0, NULL, 0, 0, coherence, NULL));
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, NULL, 64, NULL, 64, 0, coherence, &options));
    EXPECT(HGRID_OK, hgrid_occluded_n(&grid, NULL, 0, NULL, 0, 0, coherence, NULL));
    EXPECT(HGRID_OK, hgrid_occluded_n(&grid, NULL, 64, NULL, 64, 0, coherence, &options));
    CHECK(work.primitive_tests == 1 && work.cell_steps == 2 && work.grid_steps == 3);
    /* With no rays, both arrays may be the same: no byte of them is used. */
    EXPECT(HGRID_OK, hgrid_intersect_n(&grid, rays, 0, (hgrid_hit *)(void *)rays, 0, 0, coherence,
                                       NULL));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT,
           hgrid_intersect_n(NULL, NULL, 0, NULL, 0, 0, coherence, NULL));
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    make_rays();
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        grid = build_exactly(&mesh, &config, NULL, NULL);
        ask_one_by_one();
        for (size_t c = 0; c < sizeof COHERENCES / sizeof *COHERENCES; c++) {
            tight_arrays(COHERENCES[c]);
            gaps_are_not_touched(COHERENCES[c]);
            rays_and_answers_in_one_struct(COHERENCES[c]);
            packed_pairs(COHERENCES[c]);
            counters_add_up(COHERENCES[c]);
            options_are_for_all_rays(COHERENCES[c]);
        }
        scratch_may_be_anything();
    }
    scratch_is_nobody_elses();
    misuse_is_refused();
    impossible_strides_are_refused();
    overlaps_are_refused();
    no_rays_are_no_error();
    return 0;
}
