/*
 * hgrid: a ray-tracing acceleration structure that a renderer links and a microcontroller can carry.
 *
 * It builds a tree, or one of the four grids of the paper "Multi-Level Hashed Grid Construction
 * Methods" (2010), over a triangle mesh, in time proportional to the number of triangles and in
 * memory that you bring, and traces rays through it. In this file a grid is any structure that a
 * build makes, a tree, too; only "the grids of the paper" are the other four. This file is the whole
 * manual. It is made from the sources in capi/: change it there.
 *
 * Three calls
 * -----------
 *   hgrid_sizes       how much memory does this mesh take?     optional: there are bounds, too
 *   hgrid_build       mesh + memory -> grid
 *   hgrid_intersect   grid + ray -> hit;  hgrid_occluded only says whether there is one, and
 *                     hgrid_occluder names one
 *
 * More calls
 * ----------
 *   hgrid_intersect_n, hgrid_occluded_n,       many rays at once, from your structs into your structs;
 *   hgrid_occluder_n                           against shapes and in scenes: hgrid_intersect_shapes_n,
 *                                              hgrid_occluded_shapes_n, hgrid_intersect_scene_n,
 *                                              hgrid_occluded_scene_n
 *   hgrid_intersect_all                        every triangle along a ray
 *   hgrid_closest_point                        the point of the mesh that is nearest to a point
 *   hgrid_surface_at, hgrid_scene_surface_at   the normal of a hit, and origins of rays that leave it
 *   hgrid_bound, hgrid_sizes, hgrid_fit        memory for any mesh, for this one; the best grid for a
 *                                              budget
 *   hgrid_refit                                fits a tree to vertices that moved
 *   hgrid_join, hgrid_locate                   several meshes in one grid; which of them was hit
 *   hgrid_build_shapes                         a tree of your own shapes
 *   hgrid_build_scene                          a scene of instances; hgrid_scene_locate and
 *                                              hgrid_scene_instance tell which was hit
 *   hgrid_open, hgrid_peek, hgrid_validate,    stored grids; with the mesh in one file: hgrid_pack and
 *   hgrid_pack, hgrid_mesh_of                  hgrid_mesh_of; scenes with all they show: hgrid_pack_scene
 *   hgrid_inspect                              statistics of a grid
 *   hgrid_box_of, hgrid_box_of_shapes,         the box of a grid, of shapes, of a scene: to place a camera
 *   hgrid_box_of_scene
 *
 * Masks, culling, a triangle to skip, filters and counters are options of queries. hgrid_config has the
 * fields for a build on your threads, and for its progress.
 *
 *   #include <hgrid.h>
 *   #include <math.h>
 *   #include <stdio.h>
 *
 *   static const float positions[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
 *   static const uint32_t indices[2][3] = {{0, 1, 2}, {2, 1, 3}};
 *   HGRID_ALIGNED static unsigned char memory[HGRID_INDEX_BOUND(2)], scratch[HGRID_SCRATCH_BOUND(2)];
 *
 *   int main(void)
 *   {
 *       hgrid_mesh mesh = HGRID_MESH_INIT;
 *       mesh.positions = positions, mesh.vertex_count = 4;
 *       mesh.indices = indices, mesh.triangle_count = 2;
 *       hgrid_grid grid;
 *       hgrid_status status = hgrid_build(&mesh, NULL, memory, sizeof memory, scratch, sizeof scratch,
 *                                         &grid, NULL);
 *       if (status != HGRID_OK)
 *           return fprintf(stderr, "%s\n", hgrid_status_string(status)), 1;
 *       hgrid_ray ray = {{0.25f, 0.25f, 1}, 0, {0, 0, -1}, INFINITY};
 *       hgrid_hit hit;
 *       if (hgrid_intersect(&grid, &ray, NULL, &hit))
 *           printf("triangle %u at t = %g\n", (unsigned)hit.primitive, hit.t);
 *       return 0;
 *   }
 *
 *   cargo build --release -p hgrid-capi
 *   cc program.c -Iinclude target/release/libhgrid.a
 *
 * The library becomes part of the program and needs no other one. docs/install.md tells how to link a
 * shared library.
 *
 * Memory
 * ------
 * You bring two regions. The index keeps the grid; the scratch is free again after the build. Both
 * start at a multiple of HGRID_ALIGNMENT (64) bytes and overlap nothing else that the call uses.
 * They may hold anything before. The library allocates nothing, keeps nothing, touches nothing
 * outside the regions, and there is nothing to free. Programs that would rather not think of memory
 * link a library with the feature malloc, are compiled with -DHGRID_MALLOC (or define it before anything
 * includes this file), and have hgrid_create and hgrid_destroy as well.
 *
 * How large are the two regions?
 *
 * - Static arrays: HGRID_INDEX_BOUND and HGRID_SCRATCH_BOUND are constants that are enough for every mesh
 *   with that many triangles, with the default configuration.
 * - Where the system provides memory page by page (on Linux mmap, and large blocks of aligned_alloc):
 *   build in as much as hgrid_bound or hgrid_sizes without scratch says. Pages that the build does not
 *   touch take no memory. Copy the report's index_bytes to a smaller block if you like.
 * - Where every byte is real memory (no virtual memory, or memory that is charged when it is reserved, as
 *   on Windows and on Linux without overcommit): hgrid_sizes with scratch plans the grid and returns the
 *   exact size of the index. This takes half as long as the build, or as long (bvh, recursive).
 *
 * The index is a blob: no pointer in it, so it can be copied to another region at a multiple of 64,
 * written to a file, mapped from one, sent, or put in flash, and opened there with hgrid_open. The
 * byte order must be the same. hgrid_grid is only a view of blob and mesh.
 *
 * The mesh stays yours and stays where it is: it is read at every query. To move vertices, write them
 * while no query runs; then call hgrid_refit, or build again, in the same regions if you like; then
 * refit the scenes that show the grid.
 *
 * Methods
 * -------
 * A grid is built by one of five methods, which hgrid_config says; all of them answer every ray the
 * same, hit for hit and bit for bit.
 *
 *   HGRID_METHOD_BVH         the default: a bounding volume hierarchy over a grid of the triangles' centres,
 *                            for rays of every kind in scenes of every kind; what it takes at most is known
 *                            from the number of triangles
 *   HGRID_METHOD_ONE_LEVEL   one hashed grid, the least memory on large scans; fixed and variable are
 *                            built from it
 *   HGRID_METHOD_FIXED       a finer hashed grid under macrocells: the shortest time to a first image
 *                            among the four grids of the paper
 *   HGRID_METHOD_VARIABLE    a hashed grid with hashed subgrids, for uneven detail
 *   HGRID_METHOD_RECURSIVE   grids within grids, not hashed: to compare with
 *
 *   hgrid_config config = HGRID_CONFIG_INIT_VARIABLE;
 *
 * With one level and fixed, a build knows the exact size of the index before it writes. The other
 * methods learn the size while they write the index: hgrid_sizes with scratch returns it in
 * advance, and after HGRID_ERROR_INDEX_TOO_SMALL the former content of the index is lost.
 *
 * A library may be built with fewer methods, to be smaller. hgrid_has_method tells which it has; calls
 * that need another one return HGRID_ERROR_METHOD_LEFT_OUT. NULL for a configuration and
 * HGRID_CONFIG_INIT always mean bvh: in a library without bvh, name a method.
 *
 * Hits
 * ----
 * A hit names the triangle and the place on it. The normal is cross(b - a, c - a) for its vertices a, b,
 * c, and points to the front, from which they appear counter-clockwise: a ray hits the front if the dot
 * product of normal and direction is negative. hgrid_surface_at returns the normal, the side and origins
 * for the next ray: a ray that starts at the hit itself could hit the triangle that it leaves.
 *
 * One grid may hold several meshes: hgrid_join makes them one, without a copy, and hgrid_locate tells whose
 * triangle was hit. Masks can leave meshes out. Several grids are asked one after the other; let each hit
 * shorten the ray:
 *
 *   // grids: an array of count hgrid_grid; ray: an hgrid_ray
 *   hgrid_hit hit = {INFINITY, 0, 0, HGRID_INVALID_ID}, found;
 *   size_t object = 0;
 *   for (size_t i = 0; i < count; i++)
 *       if (hgrid_intersect(&grids[i], &ray, NULL, &found) && found.t < hit.t)
 *           hit = found, object = i, ray.t_max = found.t;
 *
 * A shadow ray is blocked if any grid blocks it.
 *
 * Pointers
 * --------
 * A pointer is NULL, or it points to what its type says, aligned as C aligns that type, and stays
 * valid during the call. These need no alignment: positions, indices, masks and boxes; the rays and
 * answers of hgrid_intersect_n, hgrid_occluded_n, hgrid_occluder_n and their like for shapes and scenes; the
 * bytes that hgrid_peek looks at; all scratch but that of builds, hgrid_sizes and hgrid_fit. Every other
 * pointer must be aligned.
 * Regions, blobs, positions, indices, masks and boxes point to as many bytes as the sizes next to them
 * say. Each function says which of its pointers may be NULL; any other NULL is answered with
 * HGRID_ERROR_NULL_ARGUMENT or, by a query that returns no status, as a miss. Outputs come last, those of
 * a batch right after its rays. Views, hits and other results are written only when a call succeeds.
 * A report is written after an error, too, and so is the size that hgrid_pack and its like tell. A region
 * (index, scratch, parts, the room for a packed blob or for views) may hold anything after an error,
 * unless the call says otherwise.
 *
 * Structs
 * -------
 * A struct that may grow starts with struct_size. Initialise it with its macro, then set what you
 * need:
 *
 *   hgrid_config config = HGRID_CONFIG_INIT;
 *   config.quality = HGRID_QUALITY_HIGH;
 *
 * Structs do not change within 0.1.x. A later version may add fields at the end, where 0 means what
 * was before. A larger struct from a program that was compiled with a later header is accepted as
 * long as all that this version does not know is 0. A value that this version does not know is an
 * error, not a default; only fields that belong to another method are not read, and an unknown verdict
 * of a filter counts as HGRID_REJECT.
 *
 * Errors
 * ------
 * Every call that can fail returns an hgrid_status: HGRID_OK, which is 0, or a negative number that
 * is never used for anything else. hgrid_status_string says in words what to do. Details (how many
 * bytes, which triangle) are in the report. A miss is not an error. Nor are odd meshes: an
 * empty mesh builds and is never hit, and a triangle with a NaN or infinite vertex is left out and
 * counted, unless HGRID_BUILD_STRICT says otherwise.
 *
 * A query of one ray or point that returns no status answers with a miss if its options break the rules. Every
 * query of one ray finds nothing for a ray of zeros. A debug build of the library (docs/c.md) stops the program at
 * both mistakes: it writes to stderr what is wrong and calls abort(); without an operating system it loops.
 *
 * Threads
 * -------
 * The library waits for no lock and starts no thread (hgrid_build uses yours if you bring some), and
 * it has no global state but one byte that remembers which vector instructions the processor has. Any
 * number of threads may query one grid at once, and calls that share no memory they write never disturb
 * each other. The text of each function has the details.
 *
 * Sanitizers
 * ----------
 * The library is compiled without instrumentation, so address and thread sanitizers do not see its
 * memory accesses. docs/c.md tells how to check them.
 *
 * Results
 * -------
 * Meshes and hits are in your units; t is in multiples of the ray's direction, whatever its length.
 * There is no epsilon: the error of a hit is relative to the ray and the triangle (hgrid_hit has the
 * bound), and whether t lies in the range is decided exactly. So meshes of any scale from 1e-30 to
 * 1e30 work; between 1e-15 and 1e15 rays are faster, as tests in float replace most tests in double.
 * Only IEEE + - * / and square roots are used, in a fixed order: the same input gives the same blobs
 * and hits, bit for bit, on every machine (but hgrid_occluder may name another triangle that blocks).
 * They are rounded to nearest, as in every C program that does not call fesetround: another mode loses
 * hits. Where denormal numbers are flushed to zero (FTZ and DAZ of x86), inputs and intermediate
 * results below 1.2e-38 become zero: scenes of size 1e-25 and less may get other hits.
 *
 * Versions
 * --------
 * HGRID_VERSION is what you compiled against, hgrid_version() what you linked. While the major
 * version is 0, both should be of the same minor version. HGRID_BLOB_VERSION is that of stored
 * grids.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */

#ifndef HGRID_H
#define HGRID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifndef HGRID_ALIGNED
/**
 * Write it before an array to align the array to 64 bytes, as regions must be:
 * `HGRID_ALIGNED static unsigned char memory[HGRID_INDEX_BOUND(1000)];`
 */
#if defined(_MSC_VER)
#define HGRID_ALIGNED __declspec(align(64))
#elif defined(__GNUC__)
#define HGRID_ALIGNED __attribute__((aligned(64)))
#elif defined(__cplusplus)
#define HGRID_ALIGNED alignas(64)
#else
#define HGRID_ALIGNED _Alignas(64)
#endif
#endif

/**
 * Bytes of index that are enough for any mesh with so many triangles, wherever they lie, with the
 * default configuration: a constant expression. A scan uses about six tenths of it, and every mesh of finite triangles
 * at least three tenths.
 * Where `size_t` has 32 bits the result wraps beyond 268 million triangles; `hgrid_bound` answers with an
 * error there.
 */
#define HGRID_INDEX_BOUND(triangles) ((size_t)16 * (triangles) + 640)

/**
 * Bytes of scratch that are enough for any mesh with so many triangles, wherever they lie, with the
 * default configuration, for a build by one task: a constant expression. With less scratch than its tasks need, a
 * build runs fewer of them. With 32 bits the result wraps beyond 252 million triangles.
 */
#define HGRID_SCRATCH_BOUND(triangles) ((size_t)17 * (triangles) + 320)

/**
 * Bytes of index that are enough for any mesh with `HGRID_CONFIG_INIT_ONE_LEVEL`: a constant expression. A scan takes
 * a sixth of it or less. With 32 bits the result wraps beyond 50 million triangles.
 */
#define HGRID_INDEX_BOUND_ONE_LEVEL(triangles) ((size_t)85 * (triangles) + 1280)

/**
 * Bytes of scratch that are enough for any mesh with `HGRID_CONFIG_INIT_ONE_LEVEL`: a constant expression.
 */
#define HGRID_SCRATCH_BOUND_ONE_LEVEL(triangles) ((size_t)5 * (triangles) + 1024)

/**
 * Bytes of scratch that are enough with `HGRID_QUALITY_HIGH`; for the index use `HGRID_INDEX_BOUND`. With 32 bits
 * the result wraps beyond 130 million triangles.
 */
#define HGRID_BVH_HIGH_SCRATCH_BOUND(triangles) ((size_t)33 * (triangles) + 64)

/**
 * Bytes of scratch that are enough for `hgrid_validate` of a grid of so many triangles: a bit for each.
 */
#define HGRID_VALIDATE_BOUND(triangles) ((size_t)(triangles) / 32 * 4 + 4)

/**
 * Bytes of index that are enough for any scene of so many instances, with the default configuration; of scratch
 * `HGRID_SCRATCH_BOUND` is enough. With 32 bits the result wraps beyond 38 million instances.
 */
#define HGRID_SCENE_BOUND(instances) ((size_t)112 * (instances) + 896)

/**
 * The id that no triangle has.
 */
#define HGRID_INVALID_ID UINT32_MAX

/**
 * The version of this header, as text.
 */
#define HGRID_VERSION_STRING "0.1.0"

/**
 * The alignment, in bytes, of these: index, every blob, the `views` of `hgrid_open_packed_scene`, and the scratch of
 * builds, `hgrid_sizes` and `hgrid_fit`. All other scratch may start anywhere.
 */
#define HGRID_ALIGNMENT 64

/**
 * The version of the blob format, the same for all methods. A blob of another version is refused:
 * build it again.
 */
#define HGRID_BLOB_VERSION 4

/**
 * Indices of 32 bits: the default of `hgrid_mesh`.
 */
#define HGRID_INDEX_U32 0

/**
 * Indices of 16 bits.
 */
#define HGRID_INDEX_U16 1

/**
 * One hashed grid with a single cell size.
 *
 * Choose it where memory is dear and the mesh is large: it takes the least for each triangle. It
 * is at its best where triangles are of similar size and everywhere, and slow where all detail is
 * in a few places of a large scene.
 *
 * Memory: `HGRID_INDEX_BOUND_ONE_LEVEL` and `HGRID_SCRATCH_BOUND_ONE_LEVEL` hold for it. The build
 * plans every byte in the scratch before it writes the index.
 */
#define HGRID_METHOD_ONE_LEVEL 1

/**
 * A hashed grid of many small cells, and above it levels of macrocells, whose bits tell which parts of space are
 * empty.
 *
 * Rays cross empty space in large steps, and the small cells hold few triangles each. Among the four grids
 * of the paper it has the shortest time to a first image. `macrocell_factor` belongs to it.
 *
 * Memory: one and a half to three times that of one level. The build plans every byte in the
 * scratch before it writes the index.
 */
#define HGRID_METHOD_FIXED 2

/**
 * A hashed grid whose crowded cells hold hashed grids of their own: subgrids, cut to what is
 * there.
 *
 * Choose it where detail is uneven but spread over the scene. Where all of it is in one spot of a
 * large scene, two levels are not enough: choose bvh. `subdivide_above` belongs to it.
 *
 * Memory: four to seven times that of one level. The exact size takes a dry run: `hgrid_sizes` without scratch
 * answers with a generous bound, with scratch with the exact size.
 */
#define HGRID_METHOD_VARIABLE 3

/**
 * Grids in the cells of grids, not hashed, as in the Manta ray tracer: what hashed grids are
 * compared with.
 *
 * Of the four grids of the paper it has the fewest ray-triangle tests, and the longest build in the most memory by
 * far. Choose it to compare, or for a mesh that never changes where memory does not matter. `depth` belongs to it.
 *
 * Memory: ten to thirteen times that of one level on scans, and about 530 bytes of scratch for each triangle. The
 * exact size takes a dry run. `hgrid_sizes` without scratch answers with a bound that no mesh comes near, up to 8
 * GiB: ask with scratch, which gives the exact size.
 */
#define HGRID_METHOD_RECURSIVE 4

/**
 * A bounding volume hierarchy: each triangle lies in one leaf, and a node has up to eight children with tight boxes.
 *
 * It is the default, for all rays and all scenes, with the smallest bound that is known before the build. `quality`
 * belongs to it. It has no cells, so `density` means nothing to it, and its resolution is 1 x 1 x 1.
 *
 * Memory: on scans about 9 bytes a triangle. What it takes at most depends on the number of triangles
 * alone and is less than twice that: `HGRID_INDEX_BOUND` and `HGRID_SCRATCH_BOUND` hold for it
 * (`HGRID_BVH_HIGH_SCRATCH_BOUND` with `HGRID_QUALITY_HIGH`). `hgrid_sizes` without scratch answers with that
 * bound; with scratch it gives the exact size. With several tasks it answers with the bound in either case,
 * because tasks fill their parts of the index side by side. In a smaller index one task builds. A tree has no
 * more than 2^31 triangles.
 *
 * The number 5 belonged to a method that was removed, and is not used again.
 */
#define HGRID_METHOD_BVH 6

/**
 * The quality of a tree by default: the shortest build, in which triangles are binned by their centres and the
 * surface area heuristic (SAH) chooses the nodes above small groups of them.
 *
 * Choose it for scenes that change, and for the first image.
 */
#define HGRID_QUALITY_FAST 0

/**
 * The quality of a tree that is built with SAH at every node, down to single triangles.
 *
 * Choose it for a scene that is traced for long. Most rays are answered sooner and the index is smaller; the build
 * takes several times as long. Measure it in architecture, where some rays take longer. It takes about 32 bytes of
 * scratch a triangle, whatever the number of tasks: `HGRID_INDEX_BOUND` and `HGRID_BVH_HIGH_SCRATCH_BOUND` hold for
 * it. All queries answer as with the other quality, and the blob has the same format.
 */
#define HGRID_QUALITY_HIGH 1

/**
 * The most levels of a recursive grid.
 */
#define HGRID_MAX_DEPTH 4

/**
 * A build flag: refuse a mesh with a triangle that is not finite, instead of leaving it out.
 */
#define HGRID_BUILD_STRICT 1

/**
 * The most tasks that a parallel build runs at once.
 */
#define HGRID_MAX_TASKS 64

/**
 * The value that `progress` of `hgrid_config` gets when the build is done.
 */
#define HGRID_PROGRESS_END 1000

/**
 * Both sides of a triangle are hit: the default of `hgrid_query_options`.
 */
#define HGRID_CULL_NONE 0

/**
 * A ray passes through triangles that show it their back.
 */
#define HGRID_CULL_BACK 1

/**
 * A ray passes through triangles that show it their front: the side from which the vertices appear
 * counter-clockwise.
 */
#define HGRID_CULL_FRONT 2

/**
 * A blob that is built over the triangles of a mesh: `hgrid_open`.
 */
#define HGRID_CONTENT_TRIANGLES 0

/**
 * A blob that is built over shapes: `hgrid_open_shapes`.
 */
#define HGRID_CONTENT_SHAPES 1

/**
 * A blob that is built over instances: `hgrid_open_scene`.
 */
#define HGRID_CONTENT_INSTANCES 2

/**
 * A scene with all that it shows: `hgrid_open_packed_scene`.
 */
#define HGRID_CONTENT_PACKED_SCENE 3

/**
 * Scenes inside one another, at most, the outermost included.
 */
#define HGRID_MAX_NESTING 4

/**
 * Raised when programs must change to go on working.
 */
#define HGRID_VERSION_MAJOR 0

/**
 * Raised when something was added. While the major version is 0, it may also break programs.
 */
#define HGRID_VERSION_MINOR 1

/**
 * Raised when something was repaired.
 */
#define HGRID_VERSION_PATCH 0

/**
 * The three numbers as one that can be compared.
 */
#define HGRID_VERSION (((HGRID_VERSION_MAJOR << 16) | (HGRID_VERSION_MINOR << 8)) | HGRID_VERSION_PATCH)

/**
 * The result of a call: `HGRID_OK`, or a negative error. `hgrid_status_string` has the text of each.
 */
typedef int32_t hgrid_status;

/**
 * Memory for one of the meshes that `hgrid_join` joins. It is the caller's, as the mesh is.
 */
typedef struct hgrid_part {
    /**
     * Private; it may hold anything before the call.
     */
    uint64_t opaque[24];
} hgrid_part;

/**
 * A triangle mesh in the caller's memory. Initialise it with `HGRID_MESH_INIT`.
 *
 * The arrays are read where they lie, never copied and never changed. The library reads nothing behind the
 * numbers of the last element. They need no alignment, so all may be fields of the caller's structs. The
 * bytes between two vertices may be read, and have no influence. Nobody may write them during a call: so
 * a batch's answers may not lie there.
 *
 * Blob and view refer to the mesh: it stays unchanged for as long as the grid is queried. The
 * struct itself is only read during the call.
 */
typedef struct hgrid_mesh {
    /**
     * `sizeof(hgrid_mesh)`.
     */
    uint32_t struct_size;
    /**
     * `HGRID_INDEX_U32` or `HGRID_INDEX_U16`. The library cannot check that it fits the array.
     */
    uint32_t index_type;
    /**
     * The first vertex: three floats x, y, z, in scene units. NULL only without vertices.
     */
    const void *positions;
    /**
     * Bytes from one vertex to the next, at least 12; 0 means 12.
     */
    size_t position_stride;
    /**
     * Number of vertices.
     */
    size_t vertex_count;
    /**
     * The first triangle: three vertex numbers, from 0. NULL only without triangles.
     */
    const void *indices;
    /**
     * Bytes from one triangle to the next, at least three indices; 0 means exactly three indices.
     */
    size_t index_stride;
    /**
     * Number of triangles, a third of the number of indices: at most 2^31 for a tree, 4294967294 for other methods.
     */
    size_t triangle_count;
    /**
     * The first triangle's mask, a `uint32_t`, or NULL: queries with a mask of their own see a
     * triangle if both have a bit in common. NULL means that every triangle has all bits.
     */
    const void *masks;
    /**
     * Bytes from one mask to the next, at least 4; 0 means 4.
     */
    size_t mask_stride;
    /**
     * The meshes that `hgrid_join` made this one of, or NULL. With them there are no arrays, and nothing is set by
     * hand.
     */
    const struct hgrid_part *parts;
    /**
     * Number of parts.
     */
    size_t part_count;
} hgrid_mesh;

/**
 * A part of a build, as `run` of a `hgrid_config` gets it: a function of this library.
 *
 * It may be called on any thread, on several at once, with the `task_context` that came
 * with it and an `index` below the `count` that came with it. It starts no thread,
 * waits for none, and never jumps out.
 */
typedef void (*hgrid_task)(void *task_context, uint32_t index);

/**
 * The configuration of a build: the method with its parameters, tasks and progress. Initialise it with
 * `HGRID_CONFIG_INIT`, which is also what NULL means, or with the macro of another method:
 * `HGRID_CONFIG_INIT_ONE_LEVEL`, `_FIXED`, `_VARIABLE`, `_RECURSIVE`.
 *
 * Each macro sets all fields: to the paper's values, or to hgrid's own where the paper gives none. To change the
 * method later, set `method` and `density`: fields of other methods are ignored.
 */
typedef struct hgrid_config {
    /**
     * `sizeof(hgrid_config)`.
     */
    uint32_t struct_size;
    /**
     * The structure to build: one of `HGRID_METHOD_...`, each of which says when to choose it.
     */
    uint32_t method;
    /**
     * Cells per triangle, above 0: 4 for one level and variable, 32 for fixed, 8 for recursive.
     * More cells mean fewer tests, more steps, more memory. `HGRID_METHOD_BVH` has no cells
     * and does not look at it.
     */
    float density;
    /**
     * For `HGRID_METHOD_FIXED`: cells of a level in one macrocell of the level above, on each
     * axis; 2 or more, usually 6.
     */
    uint32_t macrocell_factor;
    /**
     * For `HGRID_METHOD_VARIABLE`: a cell with more triangles than this gets a subgrid, if that
     * separates them; any number, usually 16.
     */
    uint32_t subdivide_above;
    /**
     * For `HGRID_METHOD_RECURSIVE`: levels of grids, 1 to `HGRID_MAX_DEPTH`, usually 3.
     */
    uint32_t depth;
    /**
     * 0. Another number is `HGRID_ERROR_STRUCT_SIZE`.
     */
    uint32_t reserved;
    /**
     * 0 or `HGRID_BUILD_STRICT`.
     */
    uint32_t flags;
    /**
     * For `HGRID_METHOD_BVH`: the most tasks that run at once, usually the number of cores. With `HGRID_QUALITY_FAST`
     * each needs scratch, which `hgrid_bound` and `hgrid_sizes` include and `HGRID_SCRATCH_BOUND` does not; with less
     * scratch the build runs fewer tasks, down to one. 0 and 1 mean a serial build; a number above `HGRID_MAX_TASKS`
     * counts as `HGRID_MAX_TASKS`. Above 1 `run` may not be NULL, not even for `hgrid_bound` and `hgrid_fit`, which do
     * not call it. The other methods build on the calling thread and ignore `tasks` and `run`.
     */
    uint32_t tasks;
    /**
     * For `HGRID_METHOD_BVH`: `HGRID_QUALITY_FAST`, which is 0, or `HGRID_QUALITY_HIGH`. The other methods do not
     * look at it.
     */
    uint32_t quality;
    /**
     * Yours: passed on to `run` and `progress`.
     */
    void *context;
    /**
     * Calls `task(task_context, index)` once for every `index` below `count`, in any order, on any
     * threads, and returns when all these calls have returned: after a join, or after any other
     * synchronisation by which the thread that leaves `run` sees what the other ones wrote. The
     * library calls it on the thread that builds, with counts from 2 to `tasks`: several times, one
     * after the other, or never: where the mesh or the scratch is small, on microcontrollers, and on processors
     * without atomic operations. May be NULL with `tasks` 0 or 1, and with other methods. `hgrid_build` has
     * an example.
     *
     * A task that is called twice, even at the same time, one that is never called, and an index
     * that is not below `count` do no harm: the build ends with `HGRID_ERROR_PARALLEL_FOR`.
     * The following cannot be detected and are undefined behaviour: a call of `task` that is made or still
     * running after `run` has returned, or that gets another `task_context`; a `run` that is left by
     * `longjmp` or by a C++ exception; a `run` that changes the mesh or the regions of the build.
     */
    void (*run)(void *context, uint32_t count, hgrid_task task, void *task_context);
    /**
     * Gets how much of a build is `done`, in thousandths from 0 to `HGRID_PROGRESS_END`, and returns true
     * to continue or false to cancel. May be NULL. It is called on the thread that builds, a few times to
     * a few hundred times. `done` grows from call to call; the last call of a build that succeeds gets
     * `HGRID_PROGRESS_END`, and its result is ignored. After false the build ends with
     * `HGRID_ERROR_CANCELLED`, after the current pass over the mesh at the latest. Calls are not spread
     * evenly: there is none while several tasks run, or while a tree of `HGRID_QUALITY_HIGH` gets its top
     * nodes. Each may take most of the time of a build. The callback may query and build other grids. It
     * must not touch the regions of this build, change its mesh, or be left by `longjmp` or by a C++ exception.
     */
    bool (*progress)(void *context, uint32_t done);
} hgrid_config;

/**
 * The results of a build, or of a call that computes sizes. Initialise it with `HGRID_REPORT_INIT`.
 *
 * Every call that takes a report sets all fields but `struct_size`, whether it succeeds or fails.
 * Fields that the call does not compute become 0, and `triangle` becomes `HGRID_INVALID_ID`.
 * `hgrid_inspect` has the statistics that take another pass over mesh and grid: triangles with two
 * equal corners, the first bad triangle, the longest list, a hash of the content.
 */
typedef struct hgrid_report {
    /**
     * `sizeof(hgrid_report)`.
     */
    uint32_t struct_size;
    /**
     * 1 if `index_bytes` is what the index region needs, to the byte; 0 if it is only enough. After a
     * build it is 1, and `index_bytes` is the size of the blob.
     */
    uint32_t is_exact;
    /**
     * Bytes that the index region needs; after a build, the size of the blob.
     */
    uint64_t index_bytes;
    /**
     * Bytes that the scratch region needs: exact for `HGRID_METHOD_ONE_LEVEL` and `HGRID_METHOD_FIXED`, and enough,
     * not always exact, for the others. After a build with several tasks, whether it succeeds or fails, it is the need
     * of a build with one task.
     */
    uint64_t scratch_bytes;
    /**
     * The first triangle that is to blame for the error, or `HGRID_INVALID_ID`. Of joined meshes it is counted
     * through all of them.
     */
    uint32_t triangle;
    /**
     * Triangles left out because a coordinate is not finite, or beyond 2^120. Known
     * after a build, as are all below.
     */
    uint32_t skipped_count;
    /**
     * Triangle ids in all cells or leaves together; for `HGRID_METHOD_VARIABLE` and
     * `HGRID_METHOD_RECURSIVE` the words of 4 bytes that ids and subgrids take together.
     */
    uint32_t reference_count;
    /**
     * The density of the outermost grid: what was asked for, or a half, a quarter, ... of it where
     * the mesh would have needed more than 16 references for each triangle. 0 for
     * `HGRID_METHOD_BVH`, which has none.
     */
    float density;
    /**
     * Cells of the outermost grid on each axis, or of the finest level under macrocells; 1 for
     * `HGRID_METHOD_BVH`.
     */
    uint32_t resolution[3];
    /**
     * 0.
     */
    uint32_t reserved;
} hgrid_report;

/**
 * A built grid and its mesh, ready for queries: a view, held by value.
 *
 * It owns nothing, so there is nothing to close or free, and it can be copied by assignment. It
 * holds the addresses of blob and mesh and is good for as long as both stay where they are,
 * unchanged. It means nothing in another process or a file: store the blob instead, and open it
 * there. A view that is all zero is recognised and answers every query with a miss.
 */
typedef struct hgrid_grid {
    /**
     * Private; some of its bytes may never have been written.
     */
    uint64_t opaque[64];
} hgrid_grid;

/**
 * A ray, or the part of it from `t_min` to `t_max`: 32 bytes, in the order of DXR's `RayDesc`.
 *
 * A point of the ray is `origin + t * direction`. The direction has any length but zero, and every
 * `t` is a multiple of it. A hit is accepted for `t_min <= t <= t_max`, both ends included. A ray
 * with a NaN anywhere, with an infinite origin or direction, with a zero direction or with
 * `t_min > t_max` hits nothing. A call for a single ray stops a debug build of the library if all bytes of the ray are
 * 0: then nobody has written it.
 */
typedef struct hgrid_ray {
    /**
     * The point at which `t` is 0, in scene units.
     */
    float origin[3];
    /**
     * The smallest `t` that is accepted, usually 0; negative reaches behind the origin.
     */
    float t_min;
    /**
     * The direction, any length but zero.
     */
    float direction[3];
    /**
     * The largest `t` that is accepted; `INFINITY` and `FLT_MAX` are both fine.
     */
    float t_max;
} hgrid_ray;

/**
 * The answer of a filter about a hit: one of `HGRID_REJECT`, `HGRID_ACCEPT` and `HGRID_ACCEPT_AND_STOP`.
 * Anything else counts as `HGRID_REJECT`.
 */
typedef uint32_t hgrid_verdict;

/**
 * The hit of a ray on a triangle: 16 bytes.
 *
 * The point is `origin + t * direction`, and also `(1 - u - v) * a + u * b + v * c` for the
 * triangle's vertices `a`, `b`, `c`, up to rounding. A hit is a function of the ray and the triangle
 * alone: other triangles, the method and the box of the grid do not change a bit of it.
 *
 * There is no epsilon, but an error bound. Let L be the largest coordinate of a vertex relative to the ray's
 * origin. The `t` of a vertex is its coordinate relative to the origin, divided by the direction, both on the axis
 * along which the direction is longest; Z is the largest `t` of the three vertices minus the least. The reported
 * hit is the exact hit of a triangle whose vertices are moved by up to 2^-50 L across the ray, with these errors:
 * `u` and `v` up to (2^-24 + 2^-38) of their value, `t` up to 2^-24 |t| + 2^-38 (|t| + Z); numbers below 1.2e-38 up
 * to 2^-149. A vertex is moved alike for all triangles that share it, so no ray passes between them.
 *
 * The range `t_min <= t <= t_max` is decided exactly, for all finite numbers, by the point where the ray's
 * line meets the plane of the unmoved vertices: a ray that starts above a plane and leaves it does not hit it,
 * however close it starts. An end of the range needs this decision only if it lies between the least and the
 * largest `t` of the vertices, or at one of them. Where a ray grazes a triangle, the `t` that follows from `u` and
 * `v` may differ from that of the plane. If the former lies outside of the range by no more than 2^-21 Z + 2^-49 T,
 * where T is the largest |t| of a vertex, the end of the range is reported. If it lies farther outside, there is
 * no hit. The reported `t` is rounded, so a range that ends at it may exclude the same hit. A triangle that is
 * farther from the origin than 2^50 times its size may be missed. (The source has the proof: core/src/triangle.rs.)
 */
typedef struct hgrid_hit {
    /**
     * Distance in multiples of the ray's direction.
     */
    float t;
    /**
     * Weight of the triangle's second vertex, 0 to 1.
     */
    float u;
    /**
     * Weight of the triangle's third vertex, 0 to 1.
     */
    float v;
    /**
     * The triangle: its position in the index array. Of joined meshes it is counted through all of them.
     */
    uint32_t primitive;
} hgrid_hit;

/**
 * Work done by queries. A query adds to it, so one struct can sum up a whole picture: begin with
 * `hgrid_counters work = {0, 0, 0}`.
 */
typedef struct hgrid_counters {
    /**
     * Ray-triangle tests.
     */
    uint64_t primitive_tests;
    /**
     * Cells and macrocells entered, empty ones included; leaves of a tree.
     */
    uint64_t cell_steps;
    /**
     * Steps down a level, into a macrocell, a subgrid or a node; 0 for a grid of one level.
     */
    uint64_t grid_steps;
} hgrid_counters;

/**
 * The options of a query. Initialise them with `HGRID_QUERY_OPTIONS_INIT`; NULL means these defaults.
 *
 * A query with options that are not the defaults is somewhat slower than one without. A tree
 * (`HGRID_METHOD_BVH`) traces the rays of a batch together whatever `mask`, `cull` and `skip` are, and
 * with a `filter` up to their first hits; with `counters`, and with the other methods, they are traced
 * one by one.
 * With options that break the rules for structs, a query of one ray or point returns a miss; a debug build of the
 * library stops. `hgrid_intersect_all` with the same options returns the error.
 */
typedef struct hgrid_query_options {
    /**
     * `sizeof(hgrid_query_options)`.
     */
    uint32_t struct_size;
    /**
     * A triangle is seen if its mask and this have a bit in common; see `masks` of `hgrid_mesh`.
     * With all bits, the default, every triangle is seen, even one whose mask is 0. 0 sees nothing, and no error
     * tells: begin with `HGRID_QUERY_OPTIONS_INIT`, not with zeros.
     */
    uint32_t mask;
    /**
     * The sides that are not hit: one of `HGRID_CULL_...`.
     */
    uint32_t cull;
    /**
     * A triangle that is not hit, usually the one that the ray leaves, or `HGRID_INVALID_ID`. Skipping needs
     * no epsilon, but a neighbour across an edge may still be hit if rounding put the origin below that neighbour. All
     * rays of a batch skip the same triangle; rays from origins of `hgrid_surface_at` need not skip any. 0 skips
     * triangle 0.
     */
    uint32_t skip;
    /**
     * Yours: passed on to `filter`.
     */
    void *context;
    /**
     * Returns whether a `hit` counts. NULL means that all hits count. `ray` is the number of the ray in
     * its batch, 0 for a single ray. `hgrid_closest_point` does not ask it.
     *
     * The filter gets the hits of a ray from near to far, at equal `t` by ascending triangle, and each
     * triangle at most once. In a batch it gets all hits of one ray before those of the next.
     * `filter_mask` selects the triangles that it is called for. It runs on the thread that called the
     * query, may query the same grid, and must not be left by `longjmp` or by a C++ exception. Here is
     * glass, which lets shadow rays pass and weakens them:
     *
     * ```c
     * typedef struct {
     *     const unsigned char *is_glass;
     *     float light;
     * } shadow;
     *
     * static hgrid_verdict pass_glass(void *context, size_t ray, const hgrid_hit *hit)
     * {
     *     shadow *to = (shadow *)context;
     *     (void)ray;
     *     if (!to->is_glass[hit->primitive])
     *         return HGRID_ACCEPT;
     *     to->light *= 0.8f;
     *     return HGRID_REJECT;
     * }
     *
     * static float light_along(const hgrid_grid *grid, const hgrid_ray *ray,
     *                          const unsigned char *is_glass)
     * {
     *     shadow to = {is_glass, 1};
     *     hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
     *     options.filter = pass_glass, options.context = &to;
     *     return hgrid_occluded(grid, ray, &options) ? 0 : to.light;
     * }
     * ```
     */
    hgrid_verdict (*filter)(void *context, size_t ray, const struct hgrid_hit *hit);
    /**
     * The counters that the work is added to, or NULL. Each thread needs its own. The rays of a batch are traced one
     * by one to be counted.
     */
    struct hgrid_counters *counters;
    /**
     * Memory in which a batch with `HGRID_COHERENCE_INCOHERENT` may sort its rays, or NULL. It may have
     * any alignment and hold anything. It may overlap none of these: rays, answers, view, blob, mesh,
     * boxes. Each thread needs its own. A filter or test that starts a batch must pass other
     * scratch. Queries of one ray or point do not look at it.
     */
    void *scratch;
    /**
     * Bytes of `scratch`. With 16 bytes for each ray a whole batch is sorted at once. With fewer, but 4
     * KiB or more, the batch is sorted window by window, as many rays as fit. With still fewer a window is
     * 256 rays on the stack. Larger windows give the answers sooner, up to millions of rays.
     */
    size_t scratch_bytes;
    /**
     * `filter` is called for the triangles whose mask has a bit in common with this one. The others are
     * opaque: their hits count without a call. With 0, the default, and with all bits it is called for
     * every triangle, even one whose mask is 0.
     *
     * In a batch, rays that meet only opaque triangles cost no more than without a filter. If an opaque
     * triangle blocks a ray, `hgrid_occluded` and its like may call the filter for other hits of the ray,
     * or not. Here are leaves, whose triangles have the mask 2, among walls:
     *
     * ```c
     * static hgrid_status light_of_rays(const hgrid_grid *grid, const hgrid_ray *rays, size_t count,
     *                                   hgrid_verdict (*is_leaf_there)(void *, size_t,
     *                                                                  const hgrid_hit *),
     *                                   void *textures, unsigned char *occluded)
     * {
     *     hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
     *     options.filter = is_leaf_there, options.context = textures;
     *     options.filter_mask = 2;
     *     return hgrid_occluded_n(grid, rays, 0, occluded, 0, count, HGRID_COHERENCE_COHERENT, &options);
     * }
     * ```
     */
    uint32_t filter_mask;
    /**
     * 0.
     */
    uint32_t reserved;
} hgrid_query_options;

/**
 * A point, and how far to look from there: 16 bytes.
 */
typedef struct hgrid_point_query {
    /**
     * The point to look from, in scene units.
     */
    float point[3];
    /**
     * The largest distance that is accepted, 0 or more; `INFINITY` and `FLT_MAX` are both fine.
     */
    float max_distance;
} hgrid_point_query;

/**
 * The point of a mesh that is closest to a point: 28 bytes.
 */
typedef struct hgrid_closest {
    /**
     * The point, in scene units.
     */
    float position[3];
    /**
     * Distance from the given point, in scene units.
     */
    float distance;
    /**
     * Weight of the triangle's second vertex, 0 to 1.
     */
    float u;
    /**
     * Weight of the triangle's third vertex, 0 to 1.
     */
    float v;
    /**
     * The triangle: its position in the index array. Of joined meshes it is counted through all of them.
     */
    uint32_t primitive;
} hgrid_closest;

/**
 * A point of a mesh where a ray met it: 52 bytes. `hgrid_surface_at` fills it.
 */
typedef struct hgrid_surface {
    /**
     * The point, in scene units; on the triangle but for the rounding to `float`.
     */
    float position[3];
    /**
     * The triangle's normal, of length 1, on the side that the ray came from.
     */
    float normal[3];
    /**
     * Origin for rays that leave on that side: reflections, and rays to lights.
     */
    float above[3];
    /**
     * Origin for rays that go on through the triangle.
     */
    float below[3];
    /**
     * 1 if the ray met the front, from which the vertices appear counter-clockwise; 0 if the back.
     */
    uint32_t is_front;
} hgrid_surface;

/**
 * Your hint about the rays of a batch, by which the library chooses their order: one of `HGRID_COHERENCE_...`. The
 * hint changes the speed, never the answers.
 */
typedef uint32_t hgrid_coherence;

/**
 * Reports what a refit did. Initialise it with `HGRID_REFIT_REPORT_INIT`.
 *
 * The costs are those of the surface area heuristic (Goldsmith and Salmon 1987): how many nodes a random line
 * through the box of the tree visits and how many triangles it tests on average, added up.
 */
typedef struct hgrid_refit_report {
    /**
     * `sizeof(hgrid_refit_report)`.
     */
    uint32_t struct_size;
    /**
     * The triangle, shape or instance that is to blame for an error, or `HGRID_INVALID_ID` if the error names none.
     * `HGRID_ERROR_MESH_MISMATCH` names none.
     */
    uint32_t triangle;
    /**
     * The cost that the tree had; 0 after an error.
     */
    double cost_before;
    /**
     * The cost that the tree has now; 0 after an error.
     */
    double cost_after;
} hgrid_refit_report;

/**
 * The contents of a blob's header. Initialise it with `HGRID_BLOB_INFO_INIT`.
 */
typedef struct hgrid_blob_info {
    /**
     * `sizeof(hgrid_blob_info)`.
     */
    uint32_t struct_size;
    /**
     * The version of the format.
     */
    uint32_t version;
    /**
     * The method that built it: one of `HGRID_METHOD_...`.
     */
    uint32_t method;
    /**
     * 1 if the mesh is in it, as `hgrid_pack` writes it, or all that a scene shows; 0 if not.
     */
    uint32_t has_mesh;
    /**
     * Vertices of its mesh; twice the number of shapes or instances; of a packed scene, the objects that its views
     * hold.
     */
    uint64_t vertex_count;
    /**
     * Triangles of its mesh; shapes or instances; grids and scenes that a packed scene shows.
     */
    uint64_t triangle_count;
    /**
     * Bytes of the grid.
     */
    uint64_t grid_bytes;
    /**
     * Bytes of all of it: of the grid, and of what is packed with it.
     */
    uint64_t total_bytes;
    /**
     * The kind of its content: one of `HGRID_CONTENT_...`.
     */
    uint32_t content;
    /**
     * 0.
     */
    uint32_t reserved;
} hgrid_blob_info;

/**
 * The statistics of a grid and its mesh. Initialise it with `HGRID_STATISTICS_INIT`.
 */
typedef struct hgrid_statistics {
    /**
     * `sizeof(hgrid_statistics)`.
     */
    uint32_t struct_size;
    /**
     * Triangles left out because a coordinate is not finite, or beyond 2^120.
     */
    uint32_t skipped_count;
    /**
     * Triangles of which two corners are the same point. They are in
     * the grid, and no ray hits them.
     */
    uint32_t degenerate_count;
    /**
     * The first skipped or degenerate triangle, or `HGRID_INVALID_ID`.
     */
    uint32_t first_bad;
    /**
     * Lists of triangles: one for each cell that has any; the leaves of a tree.
     */
    uint64_t list_count;
    /**
     * Triangle ids in all lists together.
     */
    uint64_t reference_count;
    /**
     * Ids in the longest list.
     */
    uint32_t longest_list;
    /**
     * 0.
     */
    uint32_t reserved;
    /**
     * A hash of the method, the grid's box, its resolution and its lists in order, but not of the cells that they
     * belong to. The same grid has the same hash on every platform, whatever its byte order. It does not protect
     * against forgery.
     */
    uint64_t content_hash;
} hgrid_statistics;

/**
 * The hit of a ray on a shape, as the caller's test says: 12 bytes.
 */
typedef struct hgrid_shape_hit {
    /**
     * Distance in multiples of the ray's direction.
     */
    float t;
    /**
     * Yours: handed on in the hit.
     */
    float u;
    /**
     * Yours: handed on in the hit.
     */
    float v;
} hgrid_shape_hit;

/**
 * The boxes of your own shapes (spheres, curves, height fields) and the test for them. Initialise it with
 * `HGRID_BOXES_INIT`.
 *
 * The arrays are read where they lie, as those of a mesh, and stay unchanged for as long as the tree is queried. What
 * `context` points to must be there as long, too. The struct itself is only read during the call.
 */
typedef struct hgrid_boxes {
    /**
     * `sizeof(hgrid_boxes)`.
     */
    uint32_t struct_size;
    /**
     * 0.
     */
    uint32_t reserved;
    /**
     * The first box: six floats, two opposite corners, x, y, z each. It should hold all of its shape. A box with a
     * number that is not finite, or beyond 2^120, leaves its shape out. NULL only without boxes.
     */
    const void *boxes;
    /**
     * Bytes from one box to the next, at least 24; 0 means 24.
     */
    size_t box_stride;
    /**
     * Number of boxes, at most 2^31.
     */
    size_t count;
    /**
     * The first shape's mask, a `uint32_t`, or NULL, as those of a mesh.
     */
    const void *masks;
    /**
     * Bytes from one mask to the next, at least 4; 0 means 4.
     */
    size_t mask_stride;
    /**
     * Tests a shape: writes `hit` and returns true if `ray` hits shape number `shape`. May be NULL: then nothing is
     * hit.
     *
     * `ray` has the range that is left: `t_max` is that of the closest hit so far. An answer outside this range,
     * infinite or NaN is no hit. The test is called on the thread that queries, on several at once if several query,
     * for shapes whose box the ray meets and perhaps some others, roughly front to back, and for each shape at most
     * once for each ray. It may query this tree and others, and must not be left by `longjmp` or by a C++ exception.
     */
    bool (*test)(void *context,
                 uint32_t shape,
                 const struct hgrid_ray *ray,
                 struct hgrid_shape_hit *hit);
    /**
     * Yours: passed on to `test`.
     */
    void *context;
} hgrid_boxes;

/**
 * A built tree of shapes, their boxes and their test, ready for queries: a view, held by value as a `hgrid_grid`.
 */
typedef struct hgrid_shapes {
    /**
     * Private; some of its bytes may never have been written.
     */
    uint64_t opaque[64];
} hgrid_shapes;

/**
 * A grid, a tree of shapes or a scene that instances show, by the address of its view. `hgrid_object_grid`,
 * `hgrid_object_shapes` and `hgrid_object_scene` make it. `HGRID_OBJECT_INIT`, which is all zeros, shows nothing: rays
 * miss its instances.
 *
 * The view stays where it is, with all that it refers to, for as long as scenes that show it are queried.
 */
typedef struct hgrid_object {
    /**
     * Private.
     */
    size_t opaque[4];
} hgrid_object;

/**
 * A built scene and its objects, ready for queries: a view, held by value as a `hgrid_grid`. It holds the addresses
 * of its blob and of the array of its objects, or of the `views` of a packed scene.
 */
typedef struct hgrid_scene {
    /**
     * Private; some of its bytes may never have been written.
     */
    uint64_t opaque[72];
} hgrid_scene;

/**
 * An object at a place in a scene: 72 bytes. Initialise it with `HGRID_INSTANCE_INIT`.
 */
typedef struct hgrid_instance {
    /**
     * Rows of the matrix that takes the object's directions to the scene's: `scene = linear * object + translation`.
     * Rotations, mirrors, shears and scales of any kind, as long as the matrix times its inverse in `float` is the
     * identity to 2^-10. That allows axis-aligned scales of any ratio; with rotation or shear a condition number up to
     * about 10^4.
     */
    float linear[3][3];
    /**
     * The object's number in the scene, from 0.
     */
    uint32_t object;
    /**
     * The place of the object's origin in the scene. Places are computed in double: far from the scene's origin rays
     * are traced as exactly as near it.
     */
    double translation[3];
    /**
     * A query sees the instance if its mask and this have a bit in common. A query whose mask has all bits, the
     * default, sees every instance, even one whose mask is 0.
     */
    uint32_t mask;
    /**
     * Yours: not read.
     */
    uint32_t id;
} hgrid_instance;

/**
 * A ray whose origin is in double: 48 bytes, for scenes in which float is too coarse for an origin. It has the fields
 * of `hgrid_ray` in another order: `t_min` stands behind `direction`. An origin beyond the range of float misses.
 * A call for a single ray stops a debug build of the library if all numbers of the ray are 0.
 */
typedef struct hgrid_ray_f64 {
    /**
     * The point at which `t` is 0, in scene units.
     */
    double origin[3];
    /**
     * The direction, any length but zero.
     */
    float direction[3];
    /**
     * The smallest `t` that is accepted.
     */
    float t_min;
    /**
     * The largest `t` that is accepted.
     */
    float t_max;
    /**
     * Not read.
     */
    uint32_t reserved;
} hgrid_ray_f64;

/**
 * The hit of a ray in a scene: 32 bytes.
 */
typedef struct hgrid_scene_hit {
    /**
     * Distance in multiples of the ray's direction.
     */
    float t;
    /**
     * Weight of the triangle's second vertex, 0 to 1; of a shape what its test says.
     */
    float u;
    /**
     * Weight of the triangle's third vertex, 0 to 1; of a shape what its test says.
     */
    float v;
    /**
     * The triangle or shape in its object.
     */
    uint32_t primitive;
    /**
     * Numbers of the instances that lead to the hit, from the outermost scene inwards; the rest is `HGRID_INVALID_ID`.
     */
    uint32_t path[HGRID_MAX_NESTING];
} hgrid_scene_hit;

/**
 * The options of a query of a scene. Initialise them with `HGRID_SCENE_OPTIONS_INIT`; NULL means these defaults.
 *
 * With a `filter` or `counters` the rays of a batch are traced one by one, in their order. With options that break the
 * rules for structs, a query of one ray returns a miss; a debug build of the library stops.
 */
typedef struct hgrid_scene_options {
    /**
     * `sizeof(hgrid_scene_options)`.
     */
    uint32_t struct_size;
    /**
     * An instance is seen if its mask and this have a bit in common. In it, each triangle and shape is seen if its own
     * mask has one. With all bits, the default, everything is seen, even with a mask of 0. 0 sees nothing, and no
     * error tells: begin with `HGRID_SCENE_OPTIONS_INIT`, not with zeros.
     */
    uint32_t mask;
    /**
     * The sides of triangles that are not hit: one of `HGRID_CULL_...`. The front is that of the triangle in its own
     * mesh: an instance that mirrors does not turn it round.
     */
    uint32_t cull;
    /**
     * `filter` is called for the triangles whose mask in their mesh has a bit in common with this one. The others are
     * opaque: their hits count without a call. With 0, the default, and with all bits it is called for every triangle,
     * even one whose mask is 0.
     */
    uint32_t filter_mask;
    /**
     * Yours: passed on to `filter`.
     */
    void *context;
    /**
     * Returns whether a `hit` counts. NULL means that all hits count. `ray` is the number of the ray in its batch, 0
     * for a single ray.
     *
     * Within an instance the filter is asked from near to far, and about each triangle at most once. Instances come
     * roughly front to back, so a hit that it accepts may be replaced by a closer one of another instance. Hits behind
     * one that it accepted are not shown to it, and shapes never are. In a batch it gets all hits of one ray before
     * those of the next. `HGRID_ACCEPT_AND_STOP` is the same as `HGRID_ACCEPT`. The filter runs on the calling thread,
     * may query the same scene, and must not be left by `longjmp` or by a C++ exception.
     */
    hgrid_verdict (*filter)(void *context, size_t ray, const struct hgrid_scene_hit *hit);
    /**
     * The counters that the work is added to, or NULL. An instance that a ray is tested against counts in
     * `primitive_tests`.
     */
    struct hgrid_counters *counters;
    /**
     * Memory in which a batch with `HGRID_COHERENCE_INCOHERENT` may sort its rays, or NULL: as `scratch` of
     * `hgrid_query_options`. It may overlap neither rays nor answers, nor anything that the scene refers to: each
     * batch compares it with every object, those of a scene inside once for each way that leads there. So lend it to
     * batches of more rays than there are objects, and not to others. Queries of one ray do not look at it.
     */
    void *scratch;
    /**
     * Bytes of `scratch`. With 16 bytes for each ray a whole batch is sorted at once.
     */
    size_t scratch_bytes;
} hgrid_scene_options;

/**
 * A point of a scene where a ray met a triangle: 88 bytes. `hgrid_scene_surface_at` fills it.
 */
typedef struct hgrid_scene_surface {
    /**
     * The point, in the scene.
     */
    double position[3];
    /**
     * Origin for rays that leave on the side that the ray came from: reflections, and rays to lights.
     */
    double above[3];
    /**
     * Origin for rays that go on through the triangle.
     */
    double below[3];
    /**
     * The triangle's normal in the scene, of length 1, on the side that the ray came from.
     */
    float normal[3];
    /**
     * 1 if the ray met the triangle's front, else 0; an instance that mirrors does not turn it.
     */
    uint32_t is_front;
} hgrid_scene_surface;

#if defined(HGRID_MALLOC)
/**
 * The source of memory for `hgrid_create`. Initialise it with
 * `HGRID_ALLOCATOR_INIT` and set both functions.
 *
 * The struct itself is only read during the call, but `hgrid_destroy` calls `release` with the
 * same `context`, so both must last as long as the grid. Neither function may be left by
 * `longjmp` or by a C++ exception.
 */
typedef struct hgrid_allocator {
    /**
     * `sizeof(hgrid_allocator)`.
     */
    uint32_t struct_size;
    /**
     * 0.
     */
    uint32_t reserved;
    /**
     * Yours: passed on to both functions.
     */
    void *context;
    /**
     * Gives `bytes` bytes, never 0 of them, that start at a multiple of `alignment`, a power of
     * two, and that nothing else uses until they are released. They may hold anything. NULL if
     * there are no more. Called on the thread that calls `hgrid_create`. May not be NULL.
     */
    void *(*allocate)(void *context, size_t bytes, size_t alignment);
    /**
     * Takes back what `allocate` gave, with the `bytes` and the `alignment` that it was asked for.
     * Called on the thread that calls `hgrid_create` or `hgrid_destroy`. May not be NULL.
     */
    void (*release)(void *context, void *memory, size_t bytes, size_t alignment);
} hgrid_allocator;
#endif

/**
 * Nothing is known: random rays, rays after several bounces. A tree may sort them by origin and
 * direction, in windows of as many rays as `scratch` of the options holds; rays that follow their
 * neighbours anyway are left as they are. Other methods trace each ray alone.
 */
#define HGRID_COHERENCE_INCOHERENT 0

/**
 * Rays that follow one another start near each other: camera rays of a tile, shadow rays and
 * ambient occlusion from its hits. They are traced in the order given, with a tree in groups of 64.
 * The best order takes tile after tile of 8 x 8 pixels, and within a tile one square of 4 x 4 pixels after the
 * other.
 */
#define HGRID_COHERENCE_COHERENT 1

/**
 * The ray goes on as if the triangle were not there.
 */
#define HGRID_REJECT 0

/**
 * The hit counts.
 */
#define HGRID_ACCEPT 1

/**
 * The hit counts, and it is the last one: the same as `HGRID_ACCEPT`,
 * but for `hgrid_intersect_all`.
 */
#define HGRID_ACCEPT_AND_STOP 2

/**
 * Success.
 */
#define HGRID_OK 0

/**
 * A pointer is NULL that may not be.
 */
#define HGRID_ERROR_NULL_ARGUMENT -1

/**
 * A struct's `struct_size` is smaller than the struct, or above 4096, or larger than the struct and what is behind the
 * known fields is not zero; or the `reserved` field of a struct that the call reads is not 0; or, from `hgrid_join`,
 * the size puts the next mesh at an address that is not aligned. The usual cause is a struct that was not initialised
 * with its `_INIT` macro.
 */
#define HGRID_ERROR_STRUCT_SIZE -2

/**
 * The index, the scratch, the blob, or the room for a blob or for views does not start at a multiple of
 * `HGRID_ALIGNMENT`.
 */
#define HGRID_ERROR_MISALIGNED -3

/**
 * Memory that the call writes (an index, scratch, the room for a packed blob or its views, parts) overlaps other such
 * memory or what the call reads: a mesh, boxes, instances, objects, a blob, rays. Answers of a batch are compared with
 * its rays and its scratch alone. Calls that look through all that a scene shows return it, too, if a view was
 * overwritten so that more scenes stand inside one another than `HGRID_MAX_NESTING`.
 */
#define HGRID_ERROR_OVERLAP -4

/**
 * The index is too small, or the room for a packed blob or for views. The report says how many bytes it needs.
 * `hgrid_pack`, `hgrid_pack_scene` and `hgrid_open_packed_scene` have no report: they write the number to `bytes`.
 *
 * With `HGRID_METHOD_ONE_LEVEL` and `HGRID_METHOD_FIXED` the index was not touched; with the other
 * methods the grid was written as far as it went, so the index may hold anything.
 */
#define HGRID_ERROR_INDEX_TOO_SMALL -10

/**
 * The scratch is too small. The report says how many bytes it needs. If the call has no report, its description says
 * how many.
 */
#define HGRID_ERROR_SCRATCH_TOO_SMALL -11

/**
 * The allocator has no more memory. The report says how many bytes index and scratch need.
 */
#define HGRID_ERROR_OUT_OF_MEMORY -12

/**
 * The position stride is below 12 bytes, or the box stride below 24, or the vertices or boxes do not fit into memory.
 */
#define HGRID_ERROR_INVALID_POSITIONS -20

/**
 * The index stride is below three indices, or the indices do not fit into memory.
 */
#define HGRID_ERROR_INVALID_INDICES -21

/**
 * The mesh's `index_type` is unknown to this version.
 */
#define HGRID_ERROR_INVALID_INDEX_TYPE -22

/**
 * There are more triangles, boxes or instances than the method takes, 2^31 for a tree and 4294967294 for the others;
 * or the arrays or the sizes do not fit into the machine's address space.
 */
#define HGRID_ERROR_TOO_MANY_TRIANGLES -23

/**
 * A triangle names a vertex that the mesh does not have. The report says which triangle.
 */
#define HGRID_ERROR_INDEX_OUT_OF_RANGE -24

/**
 * A triangle or a box has a number that is NaN, infinite or beyond 2^120, and `HGRID_BUILD_STRICT` is set; or, in a
 * refit with any flags, one that the build did not leave out has such a number now. The report says which.
 */
#define HGRID_ERROR_NON_FINITE -25

/**
 * The mask stride is below 4 bytes, or the masks do not fit into memory.
 */
#define HGRID_ERROR_INVALID_MASKS -26

/**
 * The parts are wrong: `hgrid_join` did not write them, or wrote them for other counts, or the mesh has arrays as
 * well. From `hgrid_join`: a mesh is joined itself, or the meshes or their vertices are too many.
 */
#define HGRID_ERROR_INVALID_PARTS -27

/**
 * The configuration's `method` is unknown to this version, or, for shapes and scenes, not `HGRID_METHOD_BVH`.
 */
#define HGRID_ERROR_INVALID_METHOD -30

/**
 * The density is NaN, infinite or not above 0, or asks for too much: more than 4096 cells on an
 * axis (1023 for `HGRID_METHOD_RECURSIVE`), or more than 8 GiB of ids and subgrids.
 */
#define HGRID_ERROR_INVALID_DENSITY -31

/**
 * The configuration's `flags` have a bit that this version does not know.
 */
#define HGRID_ERROR_INVALID_FLAGS -32

/**
 * The configuration's `macrocell_factor` is 0 or 1, and the method is `HGRID_METHOD_FIXED`.
 */
#define HGRID_ERROR_INVALID_MACROCELL_FACTOR -33

/**
 * The configuration's `depth` is 0 or above `HGRID_MAX_DEPTH`, and the method is
 * `HGRID_METHOD_RECURSIVE`.
 */
#define HGRID_ERROR_INVALID_DEPTH -34

/**
 * The configuration's `run` did not run every task exactly once before it returned.
 */
#define HGRID_ERROR_PARALLEL_FOR -36

/**
 * The configuration's `progress` answered false. There is no grid.
 */
#define HGRID_ERROR_CANCELLED -37

/**
 * The method of the configuration, or of the blob, is none that this library was built with:
 * `hgrid_has_method` tells which are.
 */
#define HGRID_ERROR_METHOD_LEFT_OUT -38

/**
 * The configuration's `quality` is unknown to this version, and the method is `HGRID_METHOD_BVH`.
 */
#define HGRID_ERROR_INVALID_QUALITY -39

/**
 * The bytes, or the view, are not a grid.
 */
#define HGRID_ERROR_NOT_A_GRID -40

/**
 * The blob was built on a machine of the other byte order.
 */
#define HGRID_ERROR_WRONG_BYTE_ORDER -41

/**
 * The blob has a format of another version than `HGRID_BLOB_VERSION`.
 */
#define HGRID_ERROR_UNSUPPORTED_VERSION -42

/**
 * The bytes end before the blob does.
 */
#define HGRID_ERROR_TRUNCATED -43

/**
 * The blob was built for a mesh with another number of vertices or triangles, or for another number of instances; or,
 * from `hgrid_refit`, a triangle that the build left out is finite now.
 */
#define HGRID_ERROR_MESH_MISMATCH -44

/**
 * The blob contradicts itself or its mesh, or the objects of a scene changed after its build.
 */
#define HGRID_ERROR_CORRUPT -45

/**
 * The blob holds a grid and no mesh, and none was brought.
 */
#define HGRID_ERROR_NO_MESH -46

/**
 * The blob is no tree (`HGRID_METHOD_BVH`), or `hgrid_pack` wrote it: refit the tree, then pack it.
 */
#define HGRID_ERROR_CANNOT_REFIT -47

/**
 * The blob was built before 0.1.0 with the method brick, which was removed: build it with another method.
 */
#define HGRID_ERROR_METHOD_REMOVED -48

/**
 * The blob is built over other primitives: open it with the function for triangles, shapes or instances. Or a scene
 * that shows shapes was to be packed: shapes cannot be packed.
 */
#define HGRID_ERROR_OTHER_CONTENT -49

/**
 * The stride of a batch's rays is below the size of a ray, or the rays do not fit into memory.
 */
#define HGRID_ERROR_INVALID_RAYS -50

/**
 * The stride of a batch's answers is below the size of one, or the answers do not fit into memory.
 */
#define HGRID_ERROR_INVALID_ANSWERS -51

/**
 * The coherence is unknown to this version.
 */
#define HGRID_ERROR_INVALID_COHERENCE -52

/**
 * The options' `cull` is unknown to this version.
 */
#define HGRID_ERROR_INVALID_CULL -53

/**
 * An instance names an object that does not exist. The report's `triangle` is the number of the instance.
 */
#define HGRID_ERROR_INSTANCE_OBJECT -60

/**
 * The matrix of an instance has no inverse that float can hold, is not finite, or takes its object beyond 2^120. The
 * report's `triangle` says which instance.
 */
#define HGRID_ERROR_INSTANCE_MATRIX -61

/**
 * The instances of a scene name more objects than were brought.
 */
#define HGRID_ERROR_MISSING_OBJECTS -62

/**
 * More scenes stand inside one another than `HGRID_MAX_NESTING`.
 */
#define HGRID_ERROR_TOO_DEEP -63

#ifdef __cplusplus
extern "C" {
#endif /* __cplusplus */

/**
 * Joins meshes: describes several of them as one, for a grid of them all.
 *
 * Nothing is copied. Each mesh keeps its arrays, with strides and an index type of its own, and with masks or
 * without. The triangles are numbered through all meshes, in the order of the array: a hit names one by that number,
 * and `hgrid_locate` tells which mesh it is of and which triangle there. Where several triangles are hit at the same
 * `t`, the one of the first mesh counts. So a grid of joined meshes is, byte by byte, that of one mesh with the same
 * triangles, and each ray takes one walk. One mesh alone is read faster than joined ones: the part of a triangle has
 * to be found, in a binary search.
 *
 * ```c
 * static hgrid_status build_both(const hgrid_mesh meshes[2], hgrid_part parts[2], void *index,
 *                                size_t index_bytes, void *scratch, size_t scratch_bytes,
 *                                hgrid_grid *grid)
 * {
 *     hgrid_mesh joined = HGRID_MESH_INIT;
 *     const hgrid_status status = hgrid_join(meshes, 2, parts, &joined);
 *     if (status != HGRID_OK)
 *         return status;
 *     return hgrid_build(&joined, NULL, index, index_bytes, scratch, scratch_bytes, grid, NULL);
 * }
 * ```
 *
 * `meshes` are `count` structs side by side, all with the same `struct_size`, none of them joined itself. They are
 * only read during the call. `parts` is memory for as many parts, which may hold anything before; it overlaps neither
 * the structs nor their arrays. It belongs to the mesh: it stays where it is, unchanged, for as long as a grid of the
 * joined mesh is queried, as the arrays do. Both may be NULL if `count` is 0: that is a mesh without triangles.
 * `joined` was initialised with `HGRID_MESH_INIT` and is good for every call that takes a mesh. It holds the number of
 * all triangles and vertices, and `parts`. It has no arrays, and its strides mean nothing. Every call that takes it,
 * `hgrid_open` too, first reads all parts. After vertices moved, the same joined mesh is good for `hgrid_refit` and
 * for another build; after arrays moved or counts changed, join the meshes again.
 *
 * The report of a build that fails names the triangle to blame by its number in the joined mesh: subtract the
 * triangle counts of the meshes before its own.
 *
 * Returns `HGRID_OK` and fills `joined`, or returns the reason and leaves it as it was; then `parts` may hold
 * anything:
 * - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_OVERLAP`;
 * - with one of the meshes: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_INDICES`,
 *   `HGRID_ERROR_INVALID_INDEX_TYPE`, `HGRID_ERROR_INVALID_MASKS`;
 * - with all of them: `HGRID_ERROR_TOO_MANY_TRIANGLES`, and `HGRID_ERROR_INVALID_PARTS` if one is joined itself, or
 *   if they are more than 2^30 - 1 or have more than 2^32 - 1 vertices together.
 *
 * Threads: any number of calls at once, each with parts and a joined mesh of its own.
 */
hgrid_status hgrid_join(const struct hgrid_mesh *meshes,
                        size_t count,
                        struct hgrid_part *parts,
                        struct hgrid_mesh *joined);

/**
 * Tells how much memory is enough for any mesh with so many triangles, wherever they
 * lie: O(1), nothing is looked at.
 *
 * `HGRID_INDEX_BOUND` and `HGRID_SCRATCH_BOUND` are the same for the default configuration as constants, rounded up
 * a little; with bvh and `tasks` above 1 the scratch is larger. The bound exceeds the need by a factor that
 * depends on the method: a scan takes a sixth of it or less with one level, six tenths with bvh; with recursive it
 * is too large to be of use.
 *
 * `config` may be NULL: the defaults. `report` may not be NULL. Returns `HGRID_OK`, and the report
 * has `index_bytes` and `scratch_bytes`; or what is wrong:
 * - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`,
 *   `HGRID_ERROR_TOO_MANY_TRIANGLES`, also if the sizes do not fit the machine's address space;
 * - with the configuration: `HGRID_ERROR_INVALID_METHOD`, `HGRID_ERROR_METHOD_LEFT_OUT`,
 *   `HGRID_ERROR_INVALID_DENSITY`, `HGRID_ERROR_INVALID_FLAGS`,
 *   `HGRID_ERROR_INVALID_MACROCELL_FACTOR`, `HGRID_ERROR_INVALID_DEPTH`,
 *   `HGRID_ERROR_INVALID_QUALITY`.
 *
 * Threads: any number of calls at once, each with a report of its own.
 */
hgrid_status hgrid_bound(size_t triangle_count,
                         const struct hgrid_config *config,
                         struct hgrid_report *report);

/**
 * Tells how much memory a build of this mesh takes.
 *
 * Without scratch (NULL, 0) the report's `scratch_bytes` and `index_bytes` are enough for a build, and
 * `is_exact` is 0. With bvh the answer is that of `hgrid_bound`: the triangles are not read, so a vertex number out of
 * range is found by the build. The other methods take two passes over the triangles, or a few. How much more
 * than enough the index is depends on the method: for a scan up to 2 times with one level, 4 with
 * fixed, 6 with variable, 2 with bvh; with recursive it is a bound that no mesh comes near.
 *
 * With `scratch_bytes` of scratch the grid is planned there: `index_bytes` is exact and `is_exact`
 * is 1. That takes about half the time of a build; with recursive and bvh, which have to build
 * the grid and keep nothing of it, all of that time. The scratch holds nothing of use afterwards.
 *
 * With `tasks` above 1 in the configuration, the sizes are those of a build with so many tasks: with
 * `HGRID_QUALITY_FAST` each takes scratch, and all of them fill the index, which may be a little larger. With bvh the
 * sizes are then bounds for any mesh, and `is_exact` is 0. The call uses neither `run` nor `progress`.
 *
 * `mesh` and `report` may not be NULL. `config` may be NULL: the defaults. `scratch` may be NULL
 * if its size is 0; scratch that is too small is no error, and counts as none.
 *
 * Returns `HGRID_OK`; or what is wrong, with the triangle that is to blame in the report:
 * - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`,
 *   `HGRID_ERROR_OVERLAP`;
 * - with the mesh: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_INDICES`,
 *   `HGRID_ERROR_INVALID_INDEX_TYPE`, `HGRID_ERROR_INVALID_MASKS`, `HGRID_ERROR_INVALID_PARTS`,
 *   `HGRID_ERROR_TOO_MANY_TRIANGLES`, `HGRID_ERROR_INDEX_OUT_OF_RANGE`, `HGRID_ERROR_NON_FINITE`;
 * - with the configuration: `HGRID_ERROR_INVALID_METHOD`, `HGRID_ERROR_METHOD_LEFT_OUT`,
 *   `HGRID_ERROR_INVALID_DENSITY`, `HGRID_ERROR_INVALID_FLAGS`,
 *   `HGRID_ERROR_INVALID_MACROCELL_FACTOR`, `HGRID_ERROR_INVALID_DEPTH`,
 *   `HGRID_ERROR_INVALID_QUALITY`.
 *
 * Threads: any number of calls at once, as long as each has a scratch and a report of its own. The
 * call starts no thread.
 */
hgrid_status hgrid_sizes(const struct hgrid_mesh *mesh,
                         const struct hgrid_config *config,
                         void *scratch,
                         size_t scratch_bytes,
                         struct hgrid_report *report);

/**
 * Looks for the finest grid that fits into a budget.
 *
 * `fitted` becomes a copy of `config` with a density whose index fits into `index_bytes`, as a rule at most a step
 * below the highest one. It is found in steps down from that of `config`. A step divides the number of cells by 1.41.
 * A tree (`HGRID_METHOD_BVH`) has no cells: it fits or does not. The call does the work of `hgrid_sizes` about a dozen
 * times, and at most 22 times. A density that is too fine for a build counts as one that does not fit.
 *
 * The search relies on coarser grids being smaller. But a coarser grid may take more memory than one a few steps
 * finer. Then the density may be several steps too low, and a budget that only the finer grid fits into may be
 * refused.
 *
 * Bring as much scratch as `hgrid_sizes` without scratch returns. With less, the grid may become coarser
 * than the index requires: with `HGRID_METHOD_ONE_LEVEL` and `HGRID_METHOD_FIXED` the bound of a grid must
 * fit, with the other methods the scratch must be large enough to plan a grid. If it is too small for all
 * densities, the call returns `HGRID_ERROR_SCRATCH_TOO_SMALL`. The scratch holds nothing of use
 * afterwards.
 *
 * `mesh` and `fitted` may not be NULL. `config` may be NULL: the defaults; and it may be
 * the same as `fitted`. Initialise `fitted` before the call, even if it is `config`. `report` may be NULL,
 * and so may `scratch` if its size is 0.
 *
 * Returns `HGRID_OK`, and the report says what the fitted grid takes; or
 * `HGRID_ERROR_INDEX_TOO_SMALL`, and its `index_bytes` is what the coarsest grid takes; or
 * `HGRID_ERROR_SCRATCH_TOO_SMALL`, and its `scratch_bytes` is what it takes; or what `hgrid_sizes`
 * returns. After an error `fitted` is as it was. `run` and `progress` are not called, and the
 * sizes are those of one task. `fitted` has `tasks`, `run`, `progress` and `context` of `config`;
 * before a build with several tasks ask `hgrid_sizes` what these take.
 *
 * Threads: any number of calls at once, as long as each has a scratch, a configuration
 * to write and a report of its own.
 */
hgrid_status hgrid_fit(const struct hgrid_mesh *mesh,
                       const struct hgrid_config *config,
                       size_t index_bytes,
                       void *scratch,
                       size_t scratch_bytes,
                       struct hgrid_config *fitted,
                       struct hgrid_report *report);

/**
 * Builds a grid in memory that the caller brings.
 *
 * `index` keeps the grid (it is the blob afterwards), `scratch` is free again when the call
 * returns. Both start at a multiple of `HGRID_ALIGNMENT`, overlap neither each other nor the mesh
 * nor any struct of this call, and may hold anything before. `hgrid_sizes` tells how large they
 * must be, `HGRID_INDEX_BOUND` and `HGRID_SCRATCH_BOUND` how large is always enough with the
 * default configuration; what is more than needed is not touched. The same mesh and configuration
 * give the same bytes on every machine of the same byte order.
 *
 * `mesh` and `grid` may not be NULL. `config` may be NULL: the defaults. `index` and `scratch` may
 * be NULL if their size is 0. `report` may be NULL.
 *
 * Returns `HGRID_OK` and writes the view to `grid`, or returns the reason and leaves `grid` as it
 * was: `HGRID_ERROR_INDEX_TOO_SMALL`, `HGRID_ERROR_SCRATCH_TOO_SMALL`, `HGRID_ERROR_CANCELLED`, or
 * what `hgrid_sizes` returns. The report is written in both cases: what was built; or, if a region
 * is too small, what both need; or the triangle that is to blame.
 *
 * After an error `index` is unchanged, except in these cases, in which it may hold anything: after any error with
 * `HGRID_METHOD_BVH`; with all methods after `HGRID_ERROR_CANCELLED`; with `HGRID_METHOD_VARIABLE` and
 * `HGRID_METHOD_RECURSIVE` after `HGRID_ERROR_INDEX_TOO_SMALL` and `HGRID_ERROR_INVALID_DENSITY`. In these cases
 * queries on views of the grid that lay there before are safe, but answer wrongly. Clear such views, also `grid` if it
 * was one: `view = (hgrid_grid)HGRID_GRID_INIT`.
 *
 * If the index is too small, bvh, variable and recursive go on without writing, to compute the size: the report's
 * `index_bytes` is exact (with bvh maybe only enough), and the same call with that much succeeds.
 *
 * A build allocates nothing and needs at most 18 KiB of stack, as `hgrid_sizes`, `hgrid_fit`,
 * `hgrid_validate` and `hgrid_inspect` do; with `tasks` above 1 at most 96 KiB, and each task 13
 * KiB where it is called; all beside what `run` and `progress` take (measured on x86-64).
 *
 * # A build on threads
 *
 * The library knows no threads. With `tasks` and `run` in the configuration, a build with
 * `HGRID_METHOD_BVH` is cut into tasks: the library calls `run`, on the thread that calls this function, and `run`
 * calls the tasks, on the threads of a pool or on new ones. The blob is the same, byte for byte.
 * With POSIX threads, one for each task:
 *
 * ```c
 * typedef struct {
 *     pthread_t thread;
 *     bool has_thread;
 *     hgrid_task task;
 *     void *task_context;
 *     uint32_t index;
 * } one_task;
 *
 * static void *run_one(void *argument)
 * {
 *     const one_task *one = (const one_task *)argument;
 *     one->task(one->task_context, one->index);
 *     return NULL;
 * }
 *
 * static void run_on_threads(void *context, uint32_t count, hgrid_task task, void *task_context)
 * {
 *     one_task all[HGRID_MAX_TASKS];
 *     for (uint32_t i = 0; i < count; i++) {
 *         all[i].task = task, all[i].task_context = task_context, all[i].index = i;
 *         all[i].has_thread = pthread_create(&all[i].thread, NULL, run_one, &all[i]) == 0;
 *         if (!all[i].has_thread)
 *             run_one(&all[i]);
 *     }
 *     for (uint32_t i = 0; i < count; i++)
 *         if (all[i].has_thread)
 *             pthread_join(all[i].thread, NULL);
 *     (void)context;
 * }
 *
 * static hgrid_status build_on_threads(const hgrid_mesh *mesh, void *index, size_t index_bytes,
 *                                      void *scratch, size_t scratch_bytes, hgrid_grid *grid)
 * {
 *     hgrid_config config = HGRID_CONFIG_INIT;
 *     config.tasks = 8, config.run = run_on_threads;
 *     return hgrid_build(mesh, &config, index, index_bytes, scratch, scratch_bytes, grid, NULL);
 * }
 * ```
 *
 * `hgrid_sizes` with the same configuration tells how much memory so many tasks take. Where there
 * is less scratch, but enough for fewer tasks, there are fewer. `HGRID_ERROR_PARALLEL_FOR` says
 * that `run` ran a task twice or not at all; then the index may hold anything, and both regions
 * can be used again, as after `HGRID_ERROR_CANCELLED`.
 *
 * Threads: any number of calls at once, as long as each has regions, a view and a report of its
 * own. The call starts no thread; its tasks are called on those that `run` chooses.
 */
hgrid_status hgrid_build(const struct hgrid_mesh *mesh,
                         const struct hgrid_config *config,
                         void *index,
                         size_t index_bytes,
                         void *scratch,
                         size_t scratch_bytes,
                         struct hgrid_grid *grid,
                         struct hgrid_report *report);

/**
 * Finds the closest triangle that a ray hits.
 *
 * Returns true and writes `hit`; or returns false and writes nothing. Where several triangles are
 * hit at the same `t`, the one with the lowest number is reported. Both sides of a triangle
 * count, unless `cull` of the options says otherwise. A ray through an edge or a vertex
 * that triangles share hits at least one of them. A triangle without area, or one that is
 * seen exactly edge-on, is not hit, up to rounding.
 *
 * `options` may be NULL: the defaults. With another NULL, with a view of zeros (`HGRID_GRID_INIT`),
 * or with options that break the rules for structs, nothing is hit. A query of an uninitialised view, or
 * of one whose blob or mesh is gone, is undefined behaviour.
 *
 * A query allocates nothing and needs at most 9 KiB of stack, as all queries of one ray or point do. It
 * always ends: in a grid of one level after at most as many steps as the three resolutions add up to.
 *
 * Threads: any number of queries on the same grid at once; each thread with counters of its own.
 */
bool hgrid_intersect(const struct hgrid_grid *grid,
                     const struct hgrid_ray *ray,
                     const struct hgrid_query_options *options,
                     struct hgrid_hit *hit);

/**
 * Tells whether a ray hits anything: what `hgrid_intersect` would return, but faster.
 *
 * This is the query for shadows and visibility. It stops at the first triangle it finds in the
 * ray's range, which need not be the closest.
 *
 * `options` may be NULL: the defaults. With another NULL, with a view of zeros (`HGRID_GRID_INIT`),
 * or with options that break the rules for structs, the answer is false.
 *
 * Threads: any number of queries on the same grid at once; each thread with counters of its own.
 */
bool hgrid_occluded(const struct hgrid_grid *grid,
                    const struct hgrid_ray *ray,
                    const struct hgrid_query_options *options);

/**
 * Names a triangle that blocks a ray, or `HGRID_INVALID_ID` where `hgrid_occluded` would say false.
 *
 * The ray hits this triangle in its range. It need not be the closest one, and another one may be named
 * in a batch or on another machine. Shadow rays that follow may be tested against it first:
 *
 * ```c
 * static bool is_lit(const hgrid_grid *grid, const hgrid_ray *to_light, uint32_t *blocker)
 * {
 *     *blocker = hgrid_occluder(grid, to_light, NULL);
 *     return *blocker == HGRID_INVALID_ID;
 * }
 * ```
 *
 * `options` may be NULL: the defaults. With another NULL, with a view of zeros (`HGRID_GRID_INIT`),
 * or with options that break the rules for structs, the answer is `HGRID_INVALID_ID`.
 *
 * Threads: any number of queries on the same grid at once; each thread with counters of its own.
 */
uint32_t hgrid_occluder(const struct hgrid_grid *grid,
                        const struct hgrid_ray *ray,
                        const struct hgrid_query_options *options);

/**
 * Finds all triangles that a ray hits: by ascending `t`, where that is equal by number, each once.
 *
 * Writes the nearest hits to `hits`, up to `capacity`, and the number of all hits to `count`, which may
 * be larger; `capacity` 0 only counts. In a tree without a filter, one traversal keeps the nearest hits in
 * a heap, in time proportional to the number of hits times the logarithm of `capacity`. With a filter, and
 * with the other methods if `capacity` is too small for all hits, the ray is traversed again for every
 * sixteen hits, each time from the last of them. That takes no memory, but the time for thousands of hits
 * in one cell grows with the square of their number. Options are as with `hgrid_intersect`: a filter gets
 * each hit, from near to far, and those that it accepts are written and counted.
 *
 * The example computes how much light from the end of a ray (`t_max`) passes through panes of glass, one
 * triangle each. More than 64 panes count as a wall. (A ray through an edge that two panes share meets both.)
 *
 * ```c
 * static float light_behind(const hgrid_grid *grid, const hgrid_ray *ray, const float *share)
 * {
 *     hgrid_hit panes[64];
 *     size_t count;
 *     float light = 1;
 *     if (hgrid_intersect_all(grid, ray, NULL, panes, 64, &count) != HGRID_OK || count > 64)
 *         return 0;
 *     for (size_t i = 0; i < count; i++)
 *         light *= share[panes[i].primitive];
 *     return light;
 * }
 * ```
 *
 * `hits` may be NULL if `capacity` is 0, and overlaps nothing else that the call uses; a
 * filter may look at those that it has accepted. `options` may be NULL: the defaults.
 * Returns `HGRID_OK`, or returns the reason and writes nothing: `HGRID_ERROR_NULL_ARGUMENT`,
 * `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_STRUCT_SIZE` and `HGRID_ERROR_INVALID_CULL` (the
 * options), `HGRID_ERROR_INVALID_ANSWERS` (a capacity that is impossible). An invalid ray hits nothing: the
 * count is 0.
 *
 * Threads: any number of queries on the same grid at once; each thread with hits and counters of
 * its own.
 */
hgrid_status hgrid_intersect_all(const struct hgrid_grid *grid,
                                 const struct hgrid_ray *ray,
                                 const struct hgrid_query_options *options,
                                 struct hgrid_hit *hits,
                                 size_t capacity,
                                 size_t *count);

/**
 * Finds the point of the mesh that is closest to `point` of the query, `max_distance` away at most.
 *
 * Returns true and writes `closest`; or returns false and writes nothing. Where several triangles
 * are equally close, the one with the lowest number is reported. `query` and `closest` may not be NULL.
 *
 * ```c
 * static float distance_to(const hgrid_grid *grid, float x, float y, float z)
 * {
 *     const hgrid_point_query query = {{x, y, z}, INFINITY};
 *     hgrid_closest closest;
 *     return hgrid_closest_point(grid, &query, NULL, &closest) ? closest.distance : INFINITY;
 * }
 * ```
 *
 * Of the options, `mask`, `skip` and `counters` are used: `cell_steps` counts the lists or leaves that are
 * visited, `primitive_tests` the triangles in them, `grid_steps` the nodes of a tree. `options` may be
 * NULL: the defaults. The call returns false for invalid arguments: another NULL, a view of zeros, options
 * that break the rules, a point that is not finite, a distance that is NaN or negative. A triangle whose distance is
 * beyond the range of `float` is not found, whatever `max_distance` is.
 *
 * The call allocates nothing and always ends. With `HGRID_METHOD_BVH` it visits the nodes that are no
 * farther than the answer, wherever the point lies. With the other methods the time grows with the
 * triangles in a cube around the point that reaches as far as the answer. So they are fast near the mesh;
 * for points far outside they test a large part of all triangles.
 *
 * Threads: any number of queries on the same grid at once; each thread with counters of its own.
 */
bool hgrid_closest_point(const struct hgrid_grid *grid,
                         const struct hgrid_point_query *query,
                         const struct hgrid_query_options *options,
                         struct hgrid_closest *closest);

/**
 * Tells where a ray met the mesh, which way the triangle faces there, and where rays start that leave
 * it.
 *
 * `hit` is what a query has found for `ray`. The ray's direction tells the side. Returns true and writes `surface`;
 * or returns false and writes nothing: the hit names no triangle (as that of a miss), the ray has no direction, the
 * view is one of zeros, or a pointer is NULL. Takes about as long as a triangle test in `double`.
 *
 * A ray from `above` to that side of the triangle's plane does not hit the triangle, nor one from
 * `below` to the other side: with `t_min` 0, at any scale, alone and in a batch. So rays to lights need
 * no epsilon, and no `skip`, which would be one triangle for all rays of a batch:
 *
 * ```c
 * static bool sees_light(const hgrid_grid *grid, const hgrid_ray *ray, const hgrid_hit *hit,
 *                        const float toward[3])
 * {
 *     hgrid_surface at;
 *     if (!hgrid_surface_at(grid, ray, hit, &at))
 *         return false;
 *     const float height =
 *         at.normal[0] * toward[0] + at.normal[1] * toward[1] + at.normal[2] * toward[2];
 *     const hgrid_ray to_light = {{at.above[0], at.above[1], at.above[2]}, 0,
 *                                 {toward[0], toward[1], toward[2]}, INFINITY};
 *     return height > 0 && !hgrid_occluded(grid, &to_light, NULL);
 * }
 * ```
 *
 * An origin lies off the plane by 2^-20 of the distance from the point to the triangle's farthest corner, measured
 * along one axis, and is rounded away from the plane: far more than a test may be off. A ray nearly along the plane
 * may still hit the triangle, as the normal is rounded. A triangle without area, or a needle thinner than 1e-9 of its
 * length, has no normal to rely on; if there is none at all, `normal` faces the ray. `is_front` agrees with `cull`,
 * except for triangles that the ray sees nearly edge-on.
 *
 * Threads: any number of calls and queries on the same grid at once.
 */
bool hgrid_surface_at(const struct hgrid_grid *grid,
                      const struct hgrid_ray *ray,
                      const struct hgrid_hit *hit,
                      struct hgrid_surface *surface);

/**
 * Tells which mesh a triangle is of, in a grid of meshes that `hgrid_join` joined.
 *
 * `primitive` is the number that a hit has. Returns true and writes to `geometry` the place of its mesh in the
 * array that was joined, and to `triangle` its number in that mesh's own indices; or returns false and
 * writes nothing: if the grid has no such triangle, for NULL, and for a view of zeros
 * (`HGRID_GRID_INIT`).
 *
 * In a grid of one mesh every triangle is of mesh 0. A grid that was opened from what `hgrid_pack` wrote knows
 * the meshes as well as the one that was packed. It takes a binary search among the meshes.
 *
 * ```c
 * static uint32_t material_of(const hgrid_grid *grid, const hgrid_hit *hit,
 *                             const uint32_t *const *materials)
 * {
 *     uint32_t geometry, triangle;
 *     if (!hgrid_locate(grid, hit->primitive, &geometry, &triangle))
 *         return 0;
 *     return materials[geometry][triangle];
 * }
 * ```
 *
 * Threads: any number of calls and queries on the same grid at once.
 */
bool hgrid_locate(const struct hgrid_grid *grid,
                  uint32_t primitive,
                  uint32_t *geometry,
                  uint32_t *triangle);

/**
 * Finds the closest triangle that each of many rays hits: what `hgrid_intersect` would find for
 * each, bit for bit, but faster.
 *
 * A ray lies every `ray_stride` bytes from `rays` on, and its hit goes to the same place of
 * `hits`. A miss writes a hit, too: with `primitive` equal to `HGRID_INVALID_ID`, `t` equal to
 * `INFINITY`, `u` and `v` equal to 0. Here is a tile of 8 x 8 pixels:
 *
 * ```c
 * static size_t trace_tile(const hgrid_grid *grid, const hgrid_ray rays[64], float depth[64])
 * {
 *     hgrid_hit hits[64];
 *     size_t found = 0;
 *     if (hgrid_intersect_n(grid, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
 *         return 0;
 *     for (size_t i = 0; i < 64; i++) {
 *         depth[i] = hits[i].t;
 *         found += hits[i].primitive != HGRID_INVALID_ID;
 *     }
 *     return found;
 * }
 * ```
 *
 * Rays and hits may lie in structs of yours, also in the same ones: with `struct {hgrid_ray ray;
 * hgrid_hit hit; int pixel;}` both strides are the size of the struct. A stride of 0 means side by
 * side. Neither array needs any alignment, and bytes between elements are neither read nor written.
 * No hit may overlap a ray, nor anything else that the call uses, such as blob and mesh with the bytes
 * between its vertices; the call compares hits only with rays and `scratch`. If rays and hits interleave, their
 * strides must be equal.
 *
 * `coherence` is what you know about the rays, one of `HGRID_COHERENCE_...`; it has no influence on
 * the hits. For rays without any order lend memory to sort them in, and pass as many as you have in
 * one call:
 *
 * ```c
 * static hgrid_status trace_all(const hgrid_grid *grid, const hgrid_ray *rays, hgrid_hit *hits,
 *                               size_t count, void *scratch, size_t scratch_bytes)
 * {
 *     hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
 *     options.scratch = scratch, options.scratch_bytes = scratch_bytes;
 *     return hgrid_intersect_n(grid, rays, 0, hits, 0, count, HGRID_COHERENCE_INCOHERENT, &options);
 * }
 * ```
 *
 * With `count` 0 the arguments are checked and nothing is traced. Rays are read and hits are written in any
 * order, and a ray perhaps more than once, before its hit is written.
 *
 * `rays` and `hits` may be NULL if `count` is 0. `options` may be NULL: the defaults. They are for
 * all rays.
 *
 * Returns `HGRID_OK` and has written all hits, or returns the reason and has written none:
 * `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_STRUCT_SIZE` and
 * `HGRID_ERROR_INVALID_CULL` (the options), `HGRID_ERROR_INVALID_RAYS` and
 * `HGRID_ERROR_INVALID_ANSWERS` (a stride, or a count that is impossible), `HGRID_ERROR_OVERLAP`
 * (also of `scratch`),
 * `HGRID_ERROR_INVALID_COHERENCE`. An invalid ray (a NaN, say, or no direction) is no error: it misses.
 *
 * The call allocates nothing and needs at most 40 KiB of stack.
 *
 * Threads: any number of queries on the same grid at once; each thread with hits and counters of
 * its own.
 */
hgrid_status hgrid_intersect_n(const struct hgrid_grid *grid,
                               const struct hgrid_ray *rays,
                               size_t ray_stride,
                               struct hgrid_hit *hits,
                               size_t hit_stride,
                               size_t count,
                               hgrid_coherence coherence,
                               const struct hgrid_query_options *options);

/**
 * Tells for each of many rays whether it hits anything: what `hgrid_occluded` would say for each,
 * but faster.
 *
 * Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes
 * from `occluded` on. All else is as with `hgrid_intersect_n`: strides, structs that
 * hold a ray and its byte, coherence, options and their `scratch`, stack. `rays` and `occluded` may be
 * NULL if `count` is 0, `options` may be NULL. Returns `HGRID_OK` and has written all
 * bytes, or returns what `hgrid_intersect_n` returns and has written none. For the
 * shadow rays of a tile, towards one light, which start where `hgrid_surface_at` says:
 *
 * ```c
 * static size_t count_lit(const hgrid_grid *grid, const hgrid_ray *rays, size_t count)
 * {
 *     unsigned char occluded[64];
 *     size_t lit = 0;
 *     for (size_t first = 0; first < count; first += 64) {
 *         const size_t n = count - first < 64 ? count - first : 64;
 *         if (hgrid_occluded_n(grid, rays + first, 0, occluded, 0, n, HGRID_COHERENCE_COHERENT,
 *                              NULL) != HGRID_OK)
 *             return 0;
 *         for (size_t i = 0; i < n; i++)
 *             lit += !occluded[i];
 *     }
 *     return lit;
 * }
 * ```
 *
 * Threads: any number of queries on the same grid at once; each thread with bytes and counters of
 * its own.
 */
hgrid_status hgrid_occluded_n(const struct hgrid_grid *grid,
                              const struct hgrid_ray *rays,
                              size_t ray_stride,
                              uint8_t *occluded,
                              size_t occluded_stride,
                              size_t count,
                              hgrid_coherence coherence,
                              const struct hgrid_query_options *options);

/**
 * Names for each of many rays a triangle that blocks it: as `hgrid_occluder` would, but faster.
 *
 * Writes a `uint32_t` for each ray, a triangle or `HGRID_INVALID_ID`, every `occluder_stride` bytes
 * from `occluders` on. It is `HGRID_INVALID_ID` where `hgrid_occluded_n` writes 0. Where several
 * triangles block a ray, it may be another one than `hgrid_occluder` names. All else is as with
 * `hgrid_occluded_n`. `rays` and `occluders` may be NULL if `count` is 0, `options` may be NULL.
 * Returns `HGRID_OK` and has written all names, or returns what `hgrid_intersect_n` returns and has
 * written none.
 *
 * Threads: any number of queries on the same grid at once; each thread with names and counters of
 * its own.
 */
hgrid_status hgrid_occluder_n(const struct hgrid_grid *grid,
                              const struct hgrid_ray *rays,
                              size_t ray_stride,
                              uint32_t *occluders,
                              size_t occluder_stride,
                              size_t count,
                              hgrid_coherence coherence,
                              const struct hgrid_query_options *options);

/**
 * Opens a blob that was built earlier, in another process or on another machine: O(1), no copy.
 *
 * `blob` is the index of a build, or a copy of it, at a multiple of `HGRID_ALIGNMENT`: in memory, in a mapped file, in
 * flash. It is `index_bytes` of the build's report long, or `bytes` of `hgrid_pack`; bytes behind it are ignored. It
 * says itself which method built it and how. The mesh is the one it was built for, of which only the counts are
 * compared. A blob that `hgrid_pack` wrote has its mesh in it: then `mesh` may be NULL. If you pass a mesh, it
 * replaces the one in the blob, with its masks and with what `hgrid_locate` knows of meshes that were joined.
 *
 * The call does not check the whole blob. On damaged bytes queries may answer wrongly, but they end, and
 * they read nothing outside the blob and the mesh. `hgrid_validate` proves a blob. The bytes must not
 * change while the grid is in use: do not map a file that others may write, read it into your own memory.
 *
 * `blob` and `grid` may not be NULL. Returns `HGRID_OK` and writes the view to `grid`; or returns
 * what is wrong and leaves `grid` as it was:
 * - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`;
 * - with the mesh: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_INDICES`,
 *   `HGRID_ERROR_INVALID_INDEX_TYPE`, `HGRID_ERROR_INVALID_MASKS`, `HGRID_ERROR_INVALID_PARTS`,
 *   `HGRID_ERROR_TOO_MANY_TRIANGLES`;
 * - with the blob: `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_TRUNCATED`, `HGRID_ERROR_WRONG_BYTE_ORDER`,
 *   `HGRID_ERROR_UNSUPPORTED_VERSION`, `HGRID_ERROR_METHOD_REMOVED`, `HGRID_ERROR_METHOD_LEFT_OUT`,
 *   `HGRID_ERROR_CORRUPT`, and `HGRID_ERROR_OTHER_CONTENT` for shapes and scenes;
 * - with both: `HGRID_ERROR_MESH_MISMATCH`, `HGRID_ERROR_NO_MESH`.
 *
 * Threads: any number of calls at once, also on the same blob, each with a view of its own.
 */
hgrid_status hgrid_open(const void *blob,
                        size_t blob_bytes,
                        const struct hgrid_mesh *mesh,
                        struct hgrid_grid *grid);

/**
 * Gives a tree (`HGRID_METHOD_BVH`) the boxes of a mesh whose vertices moved: in place, in a fraction of
 * the time of a build, without scratch.
 *
 * `blob` is the index of a build, or a copy of it, at a multiple of `HGRID_ALIGNMENT`; `blob_bytes` is its size, and
 * bytes behind the blob are not touched. `mesh` has the same triangles as the mesh that the tree was built for, with
 * the vertices where they are now; blob and mesh do not overlap. Queries on the view that the call writes answer as
 * those of a new build do. Do not use views that were made before the call: queries on them do no harm, but may
 * answer anything.
 *
 * The leaves stay as they were built, so rays take longer the more the mesh changes. Remember `cost_before` of
 * the first refit after a build, and build anew once `cost_after` is well above it, say by half: times of rays grow
 * about as the cost does, if the box of the tree stays about as large. A cost is relative to the surface of this box,
 * so one vertex that moves far away makes it small. Where that may be, multiply each cost by the surface of the box
 * around all vertices at that time, and compare the products.
 *
 * A triangle that the build left out, because a coordinate was not finite or beyond 2^120, is in no leaf. If it fits
 * now, the call fails: build again. Scenes that show the grid need `hgrid_refit_scene` next, the innermost first: they
 * keep its box.
 *
 * `mesh`, `blob` and `grid` may not be NULL. `report` may be NULL. Returns `HGRID_OK` and writes the view
 * to `grid`; or returns the reason, and blob and `grid` are as they were:
 * - `HGRID_ERROR_CANNOT_REFIT` for a blob of another method, and for one that `hgrid_pack` wrote;
 * - `HGRID_ERROR_MESH_MISMATCH` for a mesh with other counts, and if a triangle became finite;
 * - `HGRID_ERROR_NON_FINITE` if a triangle of a leaf is not finite any more, whatever the flags of the build;
 * - `HGRID_ERROR_INDEX_OUT_OF_RANGE`, `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_NULL_ARGUMENT`,
 *   `HGRID_ERROR_STRUCT_SIZE`;
 * - what `hgrid_open` returns.
 *
 * The report is written in both cases. The call allocates nothing, and takes the stack of a build.
 *
 * Threads: any number of calls at once, each with a blob, a view and a report of its own. No query may run
 * on the blob during the call.
 */
hgrid_status hgrid_refit(const struct hgrid_mesh *mesh,
                         void *blob,
                         size_t blob_bytes,
                         struct hgrid_grid *grid,
                         struct hgrid_refit_report *report);

/**
 * Tells what a blob is from its first 128 bytes: before there is memory for the rest, say.
 *
 * The bytes may lie at any address. `info` may not be NULL; `blob` may be NULL if
 * `blob_bytes` is 0.
 * Returns `HGRID_OK` and fills `info`, or returns the reason and leaves it as it was:
 * `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_NOT_A_GRID`,
 * `HGRID_ERROR_TRUNCATED`, `HGRID_ERROR_WRONG_BYTE_ORDER`,
 * `HGRID_ERROR_UNSUPPORTED_VERSION`, `HGRID_ERROR_METHOD_REMOVED`, `HGRID_ERROR_CORRUPT`.
 *
 * Threads: any number of calls at once, each with an info of its own.
 */
hgrid_status hgrid_peek(const void *blob, size_t blob_bytes, struct hgrid_blob_info *info);

/**
 * Writes a grid and its mesh as one blob, for which `hgrid_open` needs no mesh: to be stored where
 * the mesh is not, or mapped by several processes.
 *
 * It holds the grid, then positions, indices (of 32 bits) and masks if there are any, tight, each
 * at a multiple of 64; about 12 bytes for each vertex and for each triangle more than the grid.
 * Nothing is copied when it is opened. Meshes that were joined become one mesh with the same triangles and numbers;
 * the blob keeps where each of them begins, in 4 bytes, and `hgrid_locate` answers as before.
 *
 * `to` starts at a multiple of `HGRID_ALIGNMENT` and overlaps neither blob nor mesh nor
 * any argument of this call. It may be NULL if `capacity` is 0: to ask for the size.
 * `grid` and `bytes` may not be NULL.
 *
 * Returns `HGRID_OK` and has written the blob, or `HGRID_ERROR_INDEX_TOO_SMALL` and has
 * written none of it; in both cases `bytes` becomes its size. Or returns the reason and has
 * written nothing: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`,
 * `HGRID_ERROR_MISALIGNED`, `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_INDEX_OUT_OF_RANGE` if the
 * mesh is damaged. More than is needed is not touched.
 *
 * Threads: any number of calls and queries on the same grid at once, each with memory of its own.
 */
hgrid_status hgrid_pack(const struct hgrid_grid *grid,
                        void *to,
                        size_t capacity,
                        uint64_t *bytes);

/**
 * Tells where the mesh of a grid is: the arrays that were given to the build or to `hgrid_open`, or
 * those in a blob that `hgrid_pack` wrote (tight, with indices of 32 bits).
 *
 * `mesh` was initialised with `HGRID_MESH_INIT`, and describes the mesh as for a build: with strides that are not 0,
 * and arrays that are NULL if they are empty; without masks both of their fields are 0. Of meshes that were joined it
 * is the joined one, with `parts`, without arrays and with strides of 0, unless they were packed: a packed mesh is
 * one. It is good for as long as the grid is. Neither argument may be NULL. Returns `HGRID_OK` and fills `mesh`; or
 * `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_NULL_ARGUMENT` or `HGRID_ERROR_STRUCT_SIZE`, and leaves it as it was.
 *
 * Threads: any number of calls and queries on the same grid at once, each with a mesh of its own.
 */
hgrid_status hgrid_mesh_of(const struct hgrid_grid *grid,
                           struct hgrid_mesh *mesh);

/**
 * Proves that a blob is the grid of its mesh, and so that every answer will be right.
 *
 * Takes a small multiple of the time of a build. On damaged bytes a grid of another method than `HGRID_METHOD_BVH` may
 * take much longer, within docs/bounds.md. A grid that was just built needs no proof; a blob from a file, a network or
 * another process may.
 *
 * A tree (`HGRID_METHOD_BVH`) is proven in scratch: a bit for each triangle, of which `hgrid_validate_bytes`
 * and `HGRID_VALIDATE_BOUND` tell the bytes. The other methods take none. The scratch may lie at any
 * address, overlaps neither blob nor mesh nor any argument of this call, and may be NULL if
 * `scratch_bytes` is 0. It may hold anything before and holds nothing of use afterwards.
 *
 * Returns `HGRID_OK`; `HGRID_ERROR_CORRUPT`; `HGRID_ERROR_INDEX_OUT_OF_RANGE` if the mesh is damaged;
 * `HGRID_ERROR_SCRATCH_TOO_SMALL` or `HGRID_ERROR_OVERLAP` if the scratch is too small or overlaps;
 * `HGRID_ERROR_NOT_A_GRID` for a view of zeros (`HGRID_GRID_INIT`);
 * `HGRID_ERROR_NULL_ARGUMENT`.
 *
 * Threads: any number of calls and queries on the same grid at once, each with scratch of its own.
 */
hgrid_status hgrid_validate(const struct hgrid_grid *grid,
                            void *scratch,
                            size_t scratch_bytes);

/**
 * Tells how much scratch `hgrid_validate` takes for a grid: 0, or for a tree a bit for each
 * triangle, rounded up to four bytes.
 *
 * 0 also for NULL and for a view of zeros (`HGRID_GRID_INIT`).
 *
 * Threads: any number of calls and queries on the same grid at once.
 */
size_t hgrid_validate_bytes(const struct hgrid_grid *grid);

/**
 * Looks at all of a grid and its mesh: O(cells + ids + triangles), no memory.
 *
 * Neither argument may be NULL. Returns `HGRID_OK` and fills `statistics`; or
 * `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_NULL_ARGUMENT` or `HGRID_ERROR_STRUCT_SIZE`, and leaves
 * it as it was. On damaged bytes it counts what is there.
 *
 * Threads: any number of calls and queries on the same grid at once,
 * each with statistics of its own.
 */
hgrid_status hgrid_inspect(const struct hgrid_grid *grid, struct hgrid_statistics *statistics);

/**
 * Builds a tree over the boxes of your own shapes: `hgrid_build` for shapes.
 *
 * Memory is that of a build of as many triangles: `HGRID_INDEX_BOUND`, `HGRID_SCRATCH_BOUND`, `hgrid_bound`. The
 * method is `HGRID_METHOD_BVH`; quality, tasks and progress are as for a mesh.
 *
 * `boxes` and `shapes` may not be NULL; `config` may be: the defaults. `index` and `scratch` may be NULL if their size
 * is 0. `report` may be NULL.
 * Returns `HGRID_OK` and writes the view to `shapes`; or returns the reason and leaves `shapes` as it was:
 * - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`,
 *   `HGRID_ERROR_OVERLAP`;
 * - with the boxes: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_MASKS`,
 *   `HGRID_ERROR_TOO_MANY_TRIANGLES`, `HGRID_ERROR_NON_FINITE` with `HGRID_BUILD_STRICT`;
 * - with the configuration: `HGRID_ERROR_INVALID_METHOD`, also for another method than bvh, and what
 *   `hgrid_build` returns;
 * - with the memory: `HGRID_ERROR_INDEX_TOO_SMALL`, `HGRID_ERROR_SCRATCH_TOO_SMALL`.
 *
 * The report is written in both cases; its `triangle` is the number of a shape.
 *
 * Threads: as for `hgrid_build`.
 */
hgrid_status hgrid_build_shapes(const struct hgrid_boxes *boxes,
                                const struct hgrid_config *config,
                                void *index,
                                size_t index_bytes,
                                void *scratch,
                                size_t scratch_bytes,
                                struct hgrid_shapes *shapes,
                                struct hgrid_report *report);

/**
 * Opens a tree of shapes that was built earlier: `hgrid_open` for shapes.
 *
 * No argument may be NULL. Returns `HGRID_OK` and writes the view to `shapes`; or returns what `hgrid_open` returns
 * (`HGRID_ERROR_OTHER_CONTENT` for a blob that is no tree of shapes), or `HGRID_ERROR_INVALID_POSITIONS` and
 * `HGRID_ERROR_INVALID_MASKS` for the boxes, and leaves `shapes` as it was.
 *
 * Threads: any number of calls at once, also on the same blob, each with a view of its own.
 */
hgrid_status hgrid_open_shapes(const void *blob,
                               size_t blob_bytes,
                               const struct hgrid_boxes *boxes,
                               struct hgrid_shapes *shapes);

/**
 * Gives a tree of shapes the boxes of shapes that moved: `hgrid_refit` for shapes.
 *
 * `boxes`, `blob` and `shapes` may not be NULL; `report` may be. Returns `HGRID_OK` and writes the view to
 * `shapes`, or returns what `hgrid_refit` returns, and blob and `shapes` are as they were.
 *
 * Threads: as for `hgrid_refit`.
 */
hgrid_status hgrid_refit_shapes(const struct hgrid_boxes *boxes,
                                void *blob,
                                size_t blob_bytes,
                                struct hgrid_shapes *shapes,
                                struct hgrid_refit_report *report);

/**
 * Proves that a blob is a tree of its boxes: `hgrid_validate` for shapes, in `HGRID_VALIDATE_BOUND(count)` bytes of
 * scratch.
 *
 * Returns `HGRID_OK`, `HGRID_ERROR_CORRUPT`, `HGRID_ERROR_SCRATCH_TOO_SMALL`, `HGRID_ERROR_NOT_A_GRID` for a view of
 * zeros (`HGRID_SHAPES_INIT`), `HGRID_ERROR_OVERLAP` for scratch in the tree, its boxes, masks or view, or
 * `HGRID_ERROR_NULL_ARGUMENT`.
 *
 * Threads: any number of calls and queries on the same tree at once, each with scratch of its own.
 */
hgrid_status hgrid_validate_shapes(const struct hgrid_shapes *shapes,
                                   void *scratch,
                                   size_t scratch_bytes);

/**
 * Finds the closest shape that a ray hits.
 *
 * Returns true and writes `hit`, with the number of the shape as `primitive` and `t`, `u` and `v` as the test said;
 * or returns false and writes nothing. Where several shapes are hit at the same `t`, the one with the lowest number
 * is reported. Of the options `mask`, `skip` and `counters` are used; `cull` and `filter` are ignored. `options` may
 * be NULL. With another NULL, a view of zeros, a tree without a test, or options that break the rules for structs
 * nothing is hit.
 *
 * The test for discs that lie flat:
 *
 * ```c
 * typedef struct {
 *     float x, y, z, radius;
 * } disc;
 *
 * static bool meets_disc(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
 * {
 *     const disc *d = (const disc *)context + shape;
 *     const float t = (d->z - ray->origin[2]) / ray->direction[2];
 *     const float x = ray->origin[0] + t * ray->direction[0] - d->x;
 *     const float y = ray->origin[1] + t * ray->direction[1] - d->y;
 *     hit->t = t, hit->u = x, hit->v = y;
 *     return x * x + y * y <= d->radius * d->radius;
 * }
 * ```
 *
 * Threads: any number of queries on the same tree at once; each thread with counters of its own.
 */
bool hgrid_intersect_shapes(const struct hgrid_shapes *shapes,
                            const struct hgrid_ray *ray,
                            const struct hgrid_query_options *options,
                            struct hgrid_hit *hit);

/**
 * Tells whether a ray hits any shape: what `hgrid_intersect_shapes` would return, but faster.
 *
 * `options` may be NULL. With another NULL, and in all cases in which that function hits nothing, the answer is false.
 *
 * Threads: any number of queries on the same tree at once; each thread with counters of its own.
 */
bool hgrid_occluded_shapes(const struct hgrid_shapes *shapes,
                           const struct hgrid_ray *ray,
                           const struct hgrid_query_options *options);

/**
 * Finds the closest shape that each of many rays hits: what `hgrid_intersect_shapes` would find for each, bit for
 * bit, and sooner for rays near each other.
 *
 * It is to shapes what `hgrid_intersect_n` is to a grid, and the rules for arrays, strides and coherence are the
 * same. A miss writes a hit, too. The test gets one ray and one shape at a time, each pair at most once; calls for
 * different rays alternate. It runs on the thread that calls.
 *
 * ```c
 * static size_t trace_tile_of_shapes(const hgrid_shapes *shapes, const hgrid_ray rays[64], hgrid_hit hits[64])
 * {
 *     size_t found = 0;
 *     if (hgrid_intersect_shapes_n(shapes, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
 *         return 0;
 *     for (size_t i = 0; i < 64; i++)
 *         found += hits[i].primitive != HGRID_INVALID_ID;
 *     return found;
 * }
 * ```
 *
 * Of the options `mask`, `skip`, `counters` and `scratch` are used; with counters the rays are traced one by one.
 *
 * With `count` 0 the arguments are checked and nothing is traced. Rays are read and hits are written in any order,
 * and a ray perhaps more than once, before its hit is written. `rays` and `hits` may be NULL if `count` is 0.
 * `options` may be NULL: the defaults. They are for all rays.
 *
 * Returns `HGRID_OK` and has written all hits, or returns what `hgrid_intersect_n` returns and has written none;
 * `HGRID_ERROR_OVERLAP` also for `scratch` in the view, the blob or the boxes. A tree without a test hits nothing.
 *
 * The call allocates nothing and needs at most 40 KiB of stack, and what the test needs.
 *
 * Threads: any number of queries on the same tree at once; each thread with hits and counters of its own.
 */
hgrid_status hgrid_intersect_shapes_n(const struct hgrid_shapes *shapes,
                                      const struct hgrid_ray *rays,
                                      size_t ray_stride,
                                      struct hgrid_hit *hits,
                                      size_t hit_stride,
                                      size_t count,
                                      hgrid_coherence coherence,
                                      const struct hgrid_query_options *options);

/**
 * Tells for each of many rays whether it hits any shape: what `hgrid_occluded_shapes` would say for each, but faster.
 *
 * Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes from `occluded` on.
 * All else is as with `hgrid_intersect_shapes_n`. `rays` and `occluded` may be NULL if `count` is 0, `options` may
 * be NULL. Returns `HGRID_OK` and has written all bytes, or returns what `hgrid_intersect_shapes_n` returns and has
 * written none.
 *
 * Threads: any number of queries on the same tree at once; each thread with bytes and counters of its own.
 */
hgrid_status hgrid_occluded_shapes_n(const struct hgrid_shapes *shapes,
                                     const struct hgrid_ray *rays,
                                     size_t ray_stride,
                                     uint8_t *occluded,
                                     size_t occluded_stride,
                                     size_t count,
                                     hgrid_coherence coherence,
                                     const struct hgrid_query_options *options);

/**
 * Makes an object of a grid. The object keeps the address of this view, so the view stays where it is for as long as
 * scenes that show the object are queried.
 *
 * Neither argument may be NULL. Returns `HGRID_OK`, `HGRID_ERROR_NULL_ARGUMENT`, or `HGRID_ERROR_NOT_A_GRID` for a
 * view of zeros.
 *
 * Threads: any number of calls at once.
 */
hgrid_status hgrid_object_grid(const struct hgrid_grid *grid,
                               struct hgrid_object *object);

/**
 * Makes an object of a tree of shapes, which brings its test. The object keeps the address of the view, as that of
 * `hgrid_object_grid` does.
 *
 * The test gets the ray in the object's space, with a direction and a range of its own. The `t` of its answer is
 * along this ray. Any number of threads may call it at once. No argument may be NULL. Returns `HGRID_OK`, or what
 * `hgrid_object_grid` returns.
 *
 * Threads: any number of calls at once.
 */
hgrid_status hgrid_object_shapes(const struct hgrid_shapes *shapes,
                                 struct hgrid_object *object);

/**
 * Makes an object of a scene, to be shown in another one. The object keeps the address of the view, as that of
 * `hgrid_object_grid` does. No argument may be NULL. Returns `HGRID_OK`, or what
 * `hgrid_object_grid` returns.
 *
 * Threads: any number of calls at once.
 */
hgrid_status hgrid_object_scene(const struct hgrid_scene *scene,
                                struct hgrid_object *object);

/**
 * Tells how much memory is enough for any scene of so many instances: `hgrid_bound` for scenes. `HGRID_SCENE_BOUND`
 * and `HGRID_SCRATCH_BOUND` are the same as constants, rounded up a little.
 *
 * `config` may be NULL: the defaults. `report` may not be NULL. Returns what `hgrid_bound` returns, and
 * `HGRID_ERROR_INVALID_METHOD` for another method than bvh.
 *
 * Threads: any number of calls at once, each with a report of its own.
 */
hgrid_status hgrid_scene_bound(size_t instance_count,
                               const struct hgrid_config *config,
                               struct hgrid_report *report);

/**
 * Builds a scene: a tree over instances of objects, in O(n).
 *
 * The instances are copied. The array of objects is not: it stays where it is, with the views that it names, for as
 * long as the scene is queried. Every object in it, shown or not, begins as `HGRID_OBJECT_INIT` or comes from
 * `hgrid_object_grid` or its like; other bytes are undefined behaviour. Any number of instances may show one. Scenes
 * may be shown in scenes, `HGRID_MAX_NESTING` deep. The index is a blob, as after every build: it names objects by
 * number, and `hgrid_open_scene` opens it elsewhere with the same objects.
 *
 * ```c
 * static hgrid_status put_twice(const hgrid_grid *grid, void *index, size_t index_bytes, void *scratch,
 *                               size_t scratch_bytes, hgrid_object *object, hgrid_scene *scene)
 * {
 *     hgrid_instance two[2] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
 *     hgrid_status status = hgrid_object_grid(grid, object);
 *     if (status != HGRID_OK)
 *         return status;
 *     two[1].translation[0] = 10;
 *     return hgrid_build_scene(two, 2, object, 1, NULL, index, index_bytes, scratch, scratch_bytes, scene,
 *                              NULL);
 * }
 * ```
 *
 * `instances` may be NULL if there are none, and `objects` likewise; `index` and `scratch` may be NULL if their size
 * is 0; `scene` may not be NULL. `config` may be NULL: the defaults; its method is `HGRID_METHOD_BVH`. `report` may be
 * NULL. Index and scratch are compared with view, blob and arrays of each object, `scene` with each object's view
 * alone. What an inner scene shows is not looked at, and must lie elsewhere.
 * The call writes anywhere in as much of the index as `hgrid_scene_bound` tells for this configuration, and touches
 * none of what is behind.
 *
 * Returns `HGRID_OK` and writes the view to `scene`; or returns the reason, leaves `scene` as it was, and the index
 * holds nothing of use:
 * - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`,
 *   `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_TOO_MANY_TRIANGLES`;
 * - with an instance, whose number is the report's `triangle`: `HGRID_ERROR_INSTANCE_OBJECT`,
 *   `HGRID_ERROR_INSTANCE_MATRIX`;
 * - with the objects: `HGRID_ERROR_TOO_DEEP`;
 * - with the configuration: `HGRID_ERROR_INVALID_METHOD`, also for another method than bvh, and what `hgrid_build`
 *   returns;
 * - with the memory: `HGRID_ERROR_INDEX_TOO_SMALL`, `HGRID_ERROR_SCRATCH_TOO_SMALL`.
 *
 * Threads: as for `hgrid_build`.
 */
hgrid_status hgrid_build_scene(const struct hgrid_instance *instances,
                               size_t instance_count,
                               const struct hgrid_object *objects,
                               size_t object_count,
                               const struct hgrid_config *config,
                               void *index,
                               size_t index_bytes,
                               void *scratch,
                               size_t scratch_bytes,
                               struct hgrid_scene *scene,
                               struct hgrid_report *report);

/**
 * Opens a scene that was built earlier, with the same objects in the same order: `hgrid_open` for scenes.
 *
 * `blob` and `scene` may not be NULL; `objects` may be if there are none. Returns `HGRID_OK` and writes the view to
 * `scene`; or returns what `hgrid_open` returns, `HGRID_ERROR_OTHER_CONTENT` for a blob that is no scene,
 * `HGRID_ERROR_OVERLAP` if `scene` is the view of an object, `HGRID_ERROR_MISSING_OBJECTS` or
 * `HGRID_ERROR_TOO_DEEP`, and leaves `scene` as it was. What an inner scene shows is not compared with `scene`, and
 * must lie elsewhere.
 *
 * Threads: any number of calls at once, also on the same blob, each with a view of its own.
 */
hgrid_status hgrid_open_scene(const void *blob,
                              size_t blob_bytes,
                              const struct hgrid_object *objects,
                              size_t object_count,
                              struct hgrid_scene *scene);

/**
 * Gives a built scene instances that moved: in place, without scratch, in less than the time of a build. Call it also
 * if an object changed and no instance moved: a scene keeps the boxes that its objects had.
 *
 * There are as many instances as in the build; `hgrid_refit` says when to build anew. Arguments are as those of
 * `hgrid_build_scene`; `report` may be NULL. Returns `HGRID_OK` and writes the view to `scene`; or returns the reason
 * and leaves `scene` as it was: `HGRID_ERROR_MESH_MISMATCH` for another number of instances; what `hgrid_open_scene`
 * returns; `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE` or `HGRID_ERROR_OVERLAP`;
 * `HGRID_ERROR_INSTANCE_OBJECT` or `HGRID_ERROR_INSTANCE_MATRIX` for the instance whose number is the report's
 * `triangle`. After the last two, and if it was corrupt, the blob may hold nothing of use; after all others it is as
 * it was.
 *
 * Threads: as for `hgrid_refit`.
 */
hgrid_status hgrid_refit_scene(const struct hgrid_instance *instances,
                               size_t instance_count,
                               const struct hgrid_object *objects,
                               size_t object_count,
                               void *blob,
                               size_t blob_bytes,
                               struct hgrid_scene *scene,
                               struct hgrid_refit_report *report);

/**
 * Proves that a scene's tree and the box of every instance fit its objects, in
 * `HGRID_VALIDATE_BOUND(instance_count)` bytes of scratch. The objects have proofs of their own.
 *
 * `scene` may not be NULL; `scratch` may be if `scratch_bytes` is 0. Returns `HGRID_OK`, or what
 * `hgrid_validate_shapes` returns.
 *
 * Threads: any number of calls and queries on the same scene at once, each with scratch of its own.
 */
hgrid_status hgrid_validate_scene(const struct hgrid_scene *scene,
                                  void *scratch,
                                  size_t scratch_bytes);

/**
 * Writes a scene and all grids, meshes and scenes that it shows as one blob for `hgrid_open_packed_scene`:
 * `hgrid_pack` for scenes.
 *
 * A grid or scene is stored once, however many instances and scenes show it: the same address of a view is the same
 * grid. Shapes cannot be stored: their boxes and test are yours.
 *
 * `to` starts at a multiple of `HGRID_ALIGNMENT` and overlaps nothing that the scene refers to, nor any argument of
 * this call. It may be NULL if `capacity` is 0: to ask for the size. `scene` and `bytes` may not be NULL. The call
 * copies everything, and compares each object with every other.
 *
 * Returns `HGRID_OK` and has written the blob, or `HGRID_ERROR_INDEX_TOO_SMALL` and has written none of it; in both
 * cases `bytes` becomes its size. Or returns the reason: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`
 * (also for a cleared view among the objects), `HGRID_ERROR_MISALIGNED`, `HGRID_ERROR_OVERLAP`,
 * `HGRID_ERROR_OTHER_CONTENT` for shapes, and has written nothing. If the blob of one of the scenes was overwritten,
 * it returns what `hgrid_open_scene` returns for that, and has written nothing, either. Or it returns
 * `HGRID_ERROR_INDEX_OUT_OF_RANGE` if a mesh is damaged, after which `to` holds nothing of use. More than is
 * needed is not touched.
 *
 * Threads: any number of calls and queries on the same scene at once, each with memory of its own.
 */
hgrid_status hgrid_pack_scene(const struct hgrid_scene *scene,
                              void *to,
                              size_t capacity,
                              uint64_t *bytes);

/**
 * Opens a blob that `hgrid_pack_scene` wrote where it lies: in time proportional to the grids in it, without a copy.
 *
 * `blob` starts at a multiple of `HGRID_ALIGNMENT`; bytes behind it are ignored. `views` is memory for the views of
 * what is in it, at a multiple of `HGRID_ALIGNMENT` as well: like the blob, it stays where it is and as it is for as
 * long as the scene is queried. It may be NULL if `views_bytes` is 0: to ask for the size. A scene without instances
 * takes no views: then the call that asks for the size opens it, and returns `HGRID_OK`.
 *
 * With `scratch` all grids and scenes in the blob are proven, as `hgrid_validate` and `hgrid_validate_scene` do: a
 * 64th of the blob's bytes is enough, at any address. With NULL, and `scratch_bytes` 0, nothing is proven, and what
 * `hgrid_open` says of damaged bytes holds. Blob, views and scratch do not overlap.
 *
 * `blob`, `bytes` and `scene` may not be NULL. Returns `HGRID_OK` and writes the view to `scene`, or
 * `HGRID_ERROR_INDEX_TOO_SMALL` if the views have too little memory; in both cases `bytes` becomes what the views
 * take. Or returns the reason: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_MISALIGNED`, `HGRID_ERROR_OVERLAP`,
 * `HGRID_ERROR_OTHER_CONTENT` for a blob that is no packed scene, `HGRID_ERROR_TRUNCATED`, `HGRID_ERROR_CORRUPT`,
 * `HGRID_ERROR_SCRATCH_TOO_SMALL`, what `hgrid_open_scene` returns and what `hgrid_validate` returns. Unless it
 * returns `HGRID_OK`, `scene` stays as it was, and the views hold nothing of use.
 *
 * Threads: any number of calls at once, also on the same blob, each with a view and memory of its own.
 */
hgrid_status hgrid_open_packed_scene(const void *blob,
                                     size_t blob_bytes,
                                     void *views,
                                     size_t views_bytes,
                                     void *scratch,
                                     size_t scratch_bytes,
                                     uint64_t *bytes,
                                     struct hgrid_scene *scene);

/**
 * Finds the closest thing in a scene that a ray hits.
 *
 * Returns true and writes `hit`; or returns false and writes nothing. Where several are hit at the same `t`, that of
 * the first instance is reported, and in it the lowest number. `options` may be NULL: the defaults. With another
 * NULL, a view of zeros, or options that break the rules for structs nothing is hit.
 *
 * A query allocates nothing and always ends. It takes up to 8 KiB of stack for the scene and for each scene inside
 * it, and 9 KiB for a grid.
 *
 * Threads: any number of queries on the same scene at once; each thread with counters of its own.
 */
bool hgrid_intersect_scene(const struct hgrid_scene *scene,
                           const struct hgrid_ray_f64 *ray,
                           const struct hgrid_scene_options *options,
                           struct hgrid_scene_hit *hit);

/**
 * Tells whether a ray hits anything in a scene: what `hgrid_intersect_scene` would return, but faster.
 *
 * `options` may be NULL. With another NULL, and in all cases in which that function hits nothing, the answer is false.
 *
 * Threads: any number of queries on the same scene at once; each thread with counters of its own.
 */
bool hgrid_occluded_scene(const struct hgrid_scene *scene,
                          const struct hgrid_ray_f64 *ray,
                          const struct hgrid_scene_options *options);

/**
 * Tells what a hit names: the innermost instance on its path, with the object's number and your id, and the grid
 * that it shows.
 *
 * `grid` becomes a copy of your own view, or of the one in the `views` of a packed scene.
 * The matrix of the instance is yours but for rounding. For shapes, `grid` becomes a view of zeros. `instance` and
 * `grid` may be NULL. Returns true and has written those that are not NULL; or returns false and has written nothing:
 * `scene` or `hit` is NULL, the view is one of zeros, or the hit names nothing in the scene.
 *
 * Threads: any number of calls and queries on the same scene at once.
 */
bool hgrid_scene_locate(const struct hgrid_scene *scene,
                        const struct hgrid_scene_hit *hit,
                        struct hgrid_instance *instance,
                        struct hgrid_grid *grid);

/**
 * Tells which instance is at a level of the path of a hit. `hgrid_scene_locate` tells the innermost one, and its grid.
 *
 * At level 0 is an instance of `scene` itself. If it shows a scene, an instance of that is at level 1, and so on. The
 * number of the instance is `path[level]` of the hit. Returns true and writes `instance`; or returns false and writes
 * nothing: a pointer is NULL, the view is one of zeros, the hit names nothing in the scene, or its path has no such
 * level.
 *
 * Threads: any number of calls and queries on the same scene at once.
 */
bool hgrid_scene_instance(const struct hgrid_scene *scene,
                          const struct hgrid_scene_hit *hit,
                          uint32_t level,
                          struct hgrid_instance *instance);

/**
 * Tells where a ray met a triangle of a scene, which way the triangle faces there, and where rays start that leave it.
 *
 * It is to a scene what `hgrid_surface_at` is to a grid. `hit` is what a query has found for `ray`; the direction of
 * `ray` tells the side. Returns true and writes `surface`; or returns false and writes nothing, in these cases:
 * - the hit names no triangle, but a shape or nothing;
 * - the ray has no direction, the view is one of zeros, or a pointer is NULL;
 * - coordinates are too coarse to tell the sides of the triangle apart: `double` at this distance from the scene's
 *   origin, or `float` in the object.
 *
 * A ray from `above` to that side of the triangle's plane does not hit the triangle, nor one from `below` to the
 * other side: with `t_min` 0, at any place in the scene, alone and in a batch. Rays nearly along the plane, as the
 * object sees them, may hit it, because normal and direction are rounded. An origin is lifted as by
 * `hgrid_surface_at`, or by up to four times the rounding error of its transformation, if that is more. Do not round
 * an origin to `float`: it may lie below the plane then. What `hgrid_surface_at` says about triangles without area
 * holds here, too.
 *
 * ```c
 * static bool sees_light_in_scene(const hgrid_scene *scene, const hgrid_ray_f64 *ray, const hgrid_scene_hit *hit,
 *                                 const float toward[3])
 * {
 *     hgrid_scene_surface at;
 *     if (!hgrid_scene_surface_at(scene, ray, hit, &at))
 *         return false;
 *     const float height =
 *         at.normal[0] * toward[0] + at.normal[1] * toward[1] + at.normal[2] * toward[2];
 *     const hgrid_ray_f64 to_light = {{at.above[0], at.above[1], at.above[2]},
 *                                     {toward[0], toward[1], toward[2]}, 0, INFINITY, 0};
 *     return height > 0 && !hgrid_occluded_scene(scene, &to_light, NULL);
 * }
 * ```
 *
 * Threads: any number of calls and queries on the same scene at once.
 */
bool hgrid_scene_surface_at(const struct hgrid_scene *scene,
                            const struct hgrid_ray_f64 *ray,
                            const struct hgrid_scene_hit *hit,
                            struct hgrid_scene_surface *surface);

/**
 * Takes a normal from the space of the object that a hit names to the scene's, of length 1.
 *
 * `object_normal` is three floats of any length, or NULL: then it is the normal of the triangle that was hit,
 * cross(b - a, c - a). Returns true and writes three floats to `normal`; or returns false and writes nothing, if
 * - the hit names nothing in the scene,
 * - `object_normal` is three zeros, or one of its numbers is not finite,
 * - `object_normal` is NULL, and the hit names no triangle, or one without area,
 * - the view is one of zeros, or another pointer is NULL.
 *
 * Threads: any number of calls and queries on the same scene at once.
 */
bool hgrid_scene_normal(const struct hgrid_scene *scene,
                        const struct hgrid_scene_hit *hit,
                        const float *object_normal,
                        float *normal);

/**
 * Finds the closest thing in a scene that each of many rays hits: what `hgrid_intersect_scene` would find
 * for each, bit for bit, and sooner for rays near each other.
 *
 * It is to a scene what `hgrid_intersect_n` is to a grid, and the rules for arrays, strides and coherence are
 * the same: a ray lies every `ray_stride` bytes from `rays` on, and its hit goes to the same place of `hits`.
 * A miss writes a hit, too: with `primitive` and every number of `path` equal to `HGRID_INVALID_ID`, `t`
 * equal to `INFINITY`, `u` and `v` equal to 0. Rays that meet the same instances are traced together, so pass
 * at least a tile of 8 x 8 pixels in one call:
 *
 * ```c
 * static size_t trace_tile_of_scene(const hgrid_scene *scene, const hgrid_ray_f64 rays[64],
 *                                   hgrid_scene_hit hits[64])
 * {
 *     size_t found = 0;
 *     if (hgrid_intersect_scene_n(scene, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
 *         return 0;
 *     for (size_t i = 0; i < 64; i++)
 *         found += hits[i].primitive != HGRID_INVALID_ID;
 *     return found;
 * }
 * ```
 *
 * For rays without any order lend `scratch` of the options, and pass as many as you have in one call. With a
 * `filter` or `counters` the rays are traced one by one, in the order of the array: the filter is asked about all
 * hits of one ray before those of the next. Nested scenes are asked for each ray alone, too.
 *
 * With `count` 0 the arguments are checked and nothing is traced. Rays are read and hits are written in any
 * order, and a ray perhaps more than once, before its hit is written.
 *
 * `rays` and `hits` may be NULL if `count` is 0. `options` may be NULL: the defaults. They are for all rays.
 *
 * Returns `HGRID_OK` and has written all hits, or returns the reason and has written none:
 * `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID` for a view of zeros, `HGRID_ERROR_STRUCT_SIZE` and
 * `HGRID_ERROR_INVALID_CULL` (the options), `HGRID_ERROR_INVALID_RAYS` and `HGRID_ERROR_INVALID_ANSWERS` (a
 * stride, or a count that is impossible), `HGRID_ERROR_OVERLAP` (also of `scratch`),
 * `HGRID_ERROR_INVALID_COHERENCE`. An invalid ray (a NaN, say, or no direction) is no error: it misses.
 *
 * The call allocates nothing. It needs at most 80 KiB of stack, and 8 KiB more for each scene inside the
 * scene, and what the tests of shapes need.
 *
 * Threads: any number of queries on the same scene at once; each thread with hits and counters of its own.
 */
hgrid_status hgrid_intersect_scene_n(const struct hgrid_scene *scene,
                                     const struct hgrid_ray_f64 *rays,
                                     size_t ray_stride,
                                     struct hgrid_scene_hit *hits,
                                     size_t hit_stride,
                                     size_t count,
                                     hgrid_coherence coherence,
                                     const struct hgrid_scene_options *options);

/**
 * Tells for each of many rays whether it hits anything in a scene: what `hgrid_occluded_scene` would say for
 * each, but faster.
 *
 * Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes from
 * `occluded` on. All else is as with `hgrid_intersect_scene_n`. `rays` and `occluded` may be NULL if `count` is
 * 0, `options` may be NULL. Returns `HGRID_OK` and has written all bytes, or returns what
 * `hgrid_intersect_scene_n` returns and has written none.
 *
 * Threads: any number of queries on the same scene at once; each thread with bytes and counters of its own.
 */
hgrid_status hgrid_occluded_scene_n(const struct hgrid_scene *scene,
                                    const struct hgrid_ray_f64 *rays,
                                    size_t ray_stride,
                                    uint8_t *occluded,
                                    size_t occluded_stride,
                                    size_t count,
                                    hgrid_coherence coherence,
                                    const struct hgrid_scene_options *options);

/**
 * Tells the box of a grid: `corners` becomes six floats, the least x, y and z, then the greatest.
 *
 * It is the box of the mesh, larger by about 1e-5 of its extent, or one around the origin and smaller than 1e-33 if no
 * triangle is finite. Returns true; or returns false and writes nothing, if `grid` or `corners` is NULL or the view is
 * one of zeros.
 *
 * Threads: any number of calls and queries on the same grid at once.
 */
bool hgrid_box_of(const struct hgrid_grid *grid,
                  float *corners);

/**
 * Tells the box of all shapes: `hgrid_box_of` for a tree of shapes.
 *
 * Returns true; or returns false and writes nothing, if `shapes` or `corners` is NULL or the view is one of zeros.
 *
 * Threads: any number of calls and queries on the same tree at once.
 */
bool hgrid_box_of_shapes(const struct hgrid_shapes *shapes,
                         float *corners);

/**
 * Tells the box of all instances: `hgrid_box_of` for a scene.
 *
 * Returns true; or returns false and writes nothing, if `scene` or `corners` is NULL or the view is one of zeros.
 *
 * Threads: any number of calls and queries on the same scene at once.
 */
bool hgrid_box_of_scene(const struct hgrid_scene *scene,
                        float *corners);

#if defined(HGRID_MALLOC)
/**
 * Builds a grid in memory that the library gets itself: `hgrid_sizes`, without scratch and
 * with, and `hgrid_build`, in one call.
 *
 * Only in libraries that were built with the feature `malloc`, and declared only where `HGRID_MALLOC` is
 * defined. It takes as long as those three calls. To build again for every frame, keep the memory and
 * call `hgrid_build`.
 *
 * ```c
 * static size_t count_hits(const hgrid_mesh *mesh, const hgrid_ray *rays, size_t count)
 * {
 *     hgrid_grid *grid;
 *     if (hgrid_create(mesh, NULL, NULL, &grid, NULL) != HGRID_OK)
 *         return 0;
 *     hgrid_hit hit;
 *     size_t found = 0;
 *     for (size_t i = 0; i < count; i++)
 *         found += hgrid_intersect(grid, &rays[i], NULL, &hit);
 *     hgrid_destroy(grid);
 *     return found;
 * }
 * ```
 *
 * `allocator` says where memory comes from; NULL means the C library, as with `malloc`. It is
 * asked twice: for the scratch, which is given back before the call returns, and for the grid,
 * which takes what `hgrid_sizes` tells, to the byte, and less than 1 KiB for the view. The mesh
 * stays yours and where it is, as after `hgrid_build`.
 *
 * `mesh` and `grid` may not be NULL. `config` may be NULL: the defaults. `allocator` may be NULL.
 * `report` may be NULL.
 *
 * Returns `HGRID_OK` and writes the address of the view to `grid`; or returns the reason, has
 * given back all memory, and leaves `grid` as it was. `HGRID_ERROR_OUT_OF_MEMORY` says that the
 * allocator had no more, and the report how much was needed; `HGRID_ERROR_MISALIGNED` that what it
 * gave does not start at a multiple of the alignment. All else is what `hgrid_build` returns. The
 * report is that of `hgrid_build`.
 *
 * Threads: any number of calls at once, if the allocator's functions allow it.
 */
hgrid_status hgrid_create(const struct hgrid_mesh *mesh,
                          const struct hgrid_config *config,
                          const struct hgrid_allocator *allocator,
                          struct hgrid_grid **grid,
                          struct hgrid_report *report);
#endif

#if defined(HGRID_MALLOC)
/**
 * Gives back all memory of a grid that `hgrid_create` made.
 *
 * `grid` may be NULL: nothing happens. Otherwise it is what `hgrid_create` wrote, and is destroyed once: not the
 * view of a build or of an open, and no copy of a view. No query may run during the call, and copies of the view may
 * not be used afterwards.
 *
 * Threads: any number of calls at once, each for a grid of its own, if the allocator's functions
 * allow it; on any thread, not only on the one that created the grid.
 */
void hgrid_destroy(struct hgrid_grid *grid);
#endif

/**
 * Says in words what a status means and what to do.
 *
 * Never NULL: a number that is no status gives "unknown status". The text is static, in English,
 * without a full stop; programs compare numbers, not texts.
 *
 * Threads: any number of calls at once.
 */
const char *hgrid_status_string(hgrid_status status);

/**
 * The version of the library that is linked, to be compared with the `HGRID_VERSION` of the header
 * that was compiled against.
 *
 * Threads: any number of calls at once.
 */
uint32_t hgrid_version(void);

/**
 * The version of the library that is linked, as text: never NULL, static.
 *
 * Threads: any number of calls at once.
 */
const char *hgrid_version_string(void);

/**
 * Tells whether the linked library has a method, `HGRID_METHOD_ONE_LEVEL` and so on; false for a number
 * that is no method.
 *
 * It has all of them unless it was built with fewer, to be smaller: `cargo build --release -p
 * hgrid-capi --no-default-features --features one-level`, say.
 *
 * Threads: any number of calls at once.
 */
bool hgrid_has_method(uint32_t method);

#ifdef __cplusplus
}  /* extern "C" */
#endif  /* __cplusplus */

#endif  /* HGRID_H */

/**
 * An empty mesh of tight arrays: set positions, vertex_count, indices and triangle_count.
 */
#define HGRID_MESH_INIT {sizeof(hgrid_mesh), HGRID_INDEX_U32, NULL, 0, 0, NULL, 0, 0, NULL, 0, \
                         NULL, 0}

/**
 * The default configuration: a tree.
 */
#define HGRID_CONFIG_INIT {sizeof(hgrid_config), HGRID_METHOD_BVH, 4.0f, 6, 16, 3, 0, 0, \
                           1, 0, NULL, NULL, NULL}

/**
 * The usual configuration of a grid of one level.
 */
#define HGRID_CONFIG_INIT_ONE_LEVEL {sizeof(hgrid_config), HGRID_METHOD_ONE_LEVEL, 4.0f, 6, 16, 3, 0, 0, \
                           1, 0, NULL, NULL, NULL}

/**
 * The usual configuration of a fixed grid.
 */
#define HGRID_CONFIG_INIT_FIXED {sizeof(hgrid_config), HGRID_METHOD_FIXED, 32.0f, 6, 16, 3, 0, 0, \
                           1, 0, NULL, NULL, NULL}

/**
 * The usual configuration of a variable grid.
 */
#define HGRID_CONFIG_INIT_VARIABLE {sizeof(hgrid_config), HGRID_METHOD_VARIABLE, 4.0f, 6, 16, 3, 0, 0, \
                           1, 0, NULL, NULL, NULL}

/**
 * The usual configuration of a recursive grid.
 */
#define HGRID_CONFIG_INIT_RECURSIVE {sizeof(hgrid_config), HGRID_METHOD_RECURSIVE, 8.0f, 6, 16, 3, 0, 0, \
                           1, 0, NULL, NULL, NULL}

/**
 * The configuration of a tree.
 */
#define HGRID_CONFIG_INIT_BVH {sizeof(hgrid_config), HGRID_METHOD_BVH, 4.0f, 6, 16, 3, 0, 0, \
                           1, 0, NULL, NULL, NULL}

/**
 * No boxes: set boxes, count, test and context.
 */
#define HGRID_BOXES_INIT {sizeof(hgrid_boxes), 0, NULL, 0, 0, NULL, 0, NULL, NULL}

/**
 * An instance of object 0 where it is, seen by every query.
 */
#define HGRID_INSTANCE_INIT {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 0, {0, 0, 0}, 0xffffffffu, 0}

/**
 * The default options of a query of a scene.
 */
#define HGRID_SCENE_OPTIONS_INIT {sizeof(hgrid_scene_options), 0xffffffffu, HGRID_CULL_NONE, 0, NULL, \
                                  NULL, NULL, NULL, 0}

/**
 * The default options of a query.
 */
#define HGRID_QUERY_OPTIONS_INIT {sizeof(hgrid_query_options), 0xffffffffu, HGRID_CULL_NONE, \
                                  HGRID_INVALID_ID, NULL, NULL, NULL, NULL, 0, 0, 0}

/**
 * A report before its call.
 */
#define HGRID_REPORT_INIT {sizeof(hgrid_report), 0, 0, 0, HGRID_INVALID_ID, 0, 0, 0.0f, {0, 0, 0}, 0}

/**
 * The header of a blob before it is read.
 */
#define HGRID_BLOB_INFO_INIT {sizeof(hgrid_blob_info), 0, 0, 0, 0, 0, 0, 0, 0, 0}

/**
 * The report of a refit before its call.
 */
#define HGRID_REFIT_REPORT_INIT {sizeof(hgrid_refit_report), HGRID_INVALID_ID, 0, 0}

/**
 * Statistics before their call.
 */
#define HGRID_STATISTICS_INIT {sizeof(hgrid_statistics), 0, 0, HGRID_INVALID_ID, 0, 0, 0, 0, 0}

/**
 * Initialises a `hgrid_grid` with zeros: a view that no build or open has written, which is
 * recognised and hits nothing. After a failed build or open a view is what it was before.
 */
#define HGRID_GRID_INIT {{0}}

/**
 * Initialises a `hgrid_shapes` with zeros: a view that is recognised and hits nothing.
 */
#define HGRID_SHAPES_INIT {{0}}

/**
 * Initialises a `hgrid_scene` with zeros: a view that is recognised and hits nothing.
 */
#define HGRID_SCENE_INIT {{0}}

/**
 * Initialises a `hgrid_object` with zeros: an object that shows nothing.
 */
#define HGRID_OBJECT_INIT {{0}}

#if defined(HGRID_MALLOC)
/**
 * An allocator without functions: set allocate and release, and context if they need it.
 */
#define HGRID_ALLOCATOR_INIT {sizeof(hgrid_allocator), 0, NULL, NULL, NULL}
#endif
