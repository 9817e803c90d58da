/* Prints the header's numbers, one "name value" a line, for the test to compare. */

#define HGRID_MALLOC
#include <hgrid.h>

#include <stdio.h>

#define NUMBER(name) printf(#name " %lld\n", (long long)(name))
#define SIZE(type) printf(#type " %zu\n", sizeof(type))
#define OFFSET(type, field) printf(#type "." #field " %zu\n", offsetof(type, field))
#define BOUNDS(count) \
    printf("bounds %lu %zu %zu %zu %zu %zu %zu %zu %zu\n", (unsigned long)(count), \
           HGRID_VALIDATE_BOUND(count), HGRID_SCENE_BOUND(count), HGRID_INDEX_BOUND(count), \
           HGRID_SCRATCH_BOUND(count), HGRID_INDEX_BOUND_ONE_LEVEL(count), HGRID_SCRATCH_BOUND_ONE_LEVEL(count), \
           HGRID_INDEX_BOUND(count), HGRID_BVH_HIGH_SCRATCH_BOUND(count))

static void layout(void)
{
    SIZE(hgrid_status);
    SIZE(hgrid_coherence);
    SIZE(hgrid_verdict);
    SIZE(hgrid_task);
    SIZE(hgrid_ray);
    OFFSET(hgrid_ray, origin);
    OFFSET(hgrid_ray, t_min);
    OFFSET(hgrid_ray, direction);
    OFFSET(hgrid_ray, t_max);
    SIZE(hgrid_hit);
    OFFSET(hgrid_hit, t);
    OFFSET(hgrid_hit, u);
    OFFSET(hgrid_hit, v);
    OFFSET(hgrid_hit, primitive);
    SIZE(hgrid_counters);
    OFFSET(hgrid_counters, primitive_tests);
    OFFSET(hgrid_counters, cell_steps);
    OFFSET(hgrid_counters, grid_steps);
    SIZE(hgrid_mesh);
    OFFSET(hgrid_mesh, struct_size);
    OFFSET(hgrid_mesh, index_type);
    OFFSET(hgrid_mesh, positions);
    OFFSET(hgrid_mesh, position_stride);
    OFFSET(hgrid_mesh, vertex_count);
    OFFSET(hgrid_mesh, indices);
    OFFSET(hgrid_mesh, index_stride);
    OFFSET(hgrid_mesh, triangle_count);
    OFFSET(hgrid_mesh, masks);
    OFFSET(hgrid_mesh, mask_stride);
    OFFSET(hgrid_mesh, parts);
    OFFSET(hgrid_mesh, part_count);
    SIZE(hgrid_part);
    OFFSET(hgrid_part, opaque);
    SIZE(hgrid_config);
    OFFSET(hgrid_config, struct_size);
    OFFSET(hgrid_config, method);
    OFFSET(hgrid_config, density);
    OFFSET(hgrid_config, macrocell_factor);
    OFFSET(hgrid_config, subdivide_above);
    OFFSET(hgrid_config, depth);
    OFFSET(hgrid_config, reserved);
    OFFSET(hgrid_config, flags);
    OFFSET(hgrid_config, tasks);
    OFFSET(hgrid_config, quality);
    OFFSET(hgrid_config, context);
    OFFSET(hgrid_config, run);
    OFFSET(hgrid_config, progress);
    SIZE(hgrid_query_options);
    OFFSET(hgrid_query_options, struct_size);
    OFFSET(hgrid_query_options, mask);
    OFFSET(hgrid_query_options, cull);
    OFFSET(hgrid_query_options, skip);
    OFFSET(hgrid_query_options, context);
    OFFSET(hgrid_query_options, filter);
    OFFSET(hgrid_query_options, counters);
    OFFSET(hgrid_query_options, scratch);
    OFFSET(hgrid_query_options, scratch_bytes);
    OFFSET(hgrid_query_options, filter_mask);
    OFFSET(hgrid_query_options, reserved);
    SIZE(hgrid_point_query);
    OFFSET(hgrid_point_query, point);
    OFFSET(hgrid_point_query, max_distance);
    SIZE(hgrid_closest);
    OFFSET(hgrid_closest, position);
    OFFSET(hgrid_closest, distance);
    OFFSET(hgrid_closest, u);
    OFFSET(hgrid_closest, v);
    OFFSET(hgrid_closest, primitive);
    SIZE(hgrid_surface);
    OFFSET(hgrid_surface, position);
    OFFSET(hgrid_surface, normal);
    OFFSET(hgrid_surface, above);
    OFFSET(hgrid_surface, below);
    OFFSET(hgrid_surface, is_front);
    SIZE(hgrid_refit_report);
    OFFSET(hgrid_refit_report, struct_size);
    OFFSET(hgrid_refit_report, triangle);
    OFFSET(hgrid_refit_report, cost_before);
    OFFSET(hgrid_refit_report, cost_after);
    SIZE(hgrid_blob_info);
    OFFSET(hgrid_blob_info, struct_size);
    OFFSET(hgrid_blob_info, version);
    OFFSET(hgrid_blob_info, method);
    OFFSET(hgrid_blob_info, has_mesh);
    OFFSET(hgrid_blob_info, vertex_count);
    OFFSET(hgrid_blob_info, triangle_count);
    OFFSET(hgrid_blob_info, grid_bytes);
    OFFSET(hgrid_blob_info, total_bytes);
    OFFSET(hgrid_blob_info, content);
    OFFSET(hgrid_blob_info, reserved);
    SIZE(hgrid_statistics);
    OFFSET(hgrid_statistics, struct_size);
    OFFSET(hgrid_statistics, skipped_count);
    OFFSET(hgrid_statistics, degenerate_count);
    OFFSET(hgrid_statistics, first_bad);
    OFFSET(hgrid_statistics, list_count);
    OFFSET(hgrid_statistics, reference_count);
    OFFSET(hgrid_statistics, longest_list);
    OFFSET(hgrid_statistics, reserved);
    OFFSET(hgrid_statistics, content_hash);
    SIZE(hgrid_report);
    OFFSET(hgrid_report, struct_size);
    OFFSET(hgrid_report, is_exact);
    OFFSET(hgrid_report, index_bytes);
    OFFSET(hgrid_report, scratch_bytes);
    OFFSET(hgrid_report, triangle);
    OFFSET(hgrid_report, skipped_count);
    OFFSET(hgrid_report, reference_count);
    OFFSET(hgrid_report, density);
    OFFSET(hgrid_report, resolution);
    OFFSET(hgrid_report, reserved);
    SIZE(hgrid_grid);
    OFFSET(hgrid_grid, opaque);
    SIZE(hgrid_shape_hit);
    OFFSET(hgrid_shape_hit, t);
    OFFSET(hgrid_shape_hit, u);
    OFFSET(hgrid_shape_hit, v);
    SIZE(hgrid_boxes);
    OFFSET(hgrid_boxes, struct_size);
    OFFSET(hgrid_boxes, reserved);
    OFFSET(hgrid_boxes, boxes);
    OFFSET(hgrid_boxes, box_stride);
    OFFSET(hgrid_boxes, count);
    OFFSET(hgrid_boxes, masks);
    OFFSET(hgrid_boxes, mask_stride);
    OFFSET(hgrid_boxes, test);
    OFFSET(hgrid_boxes, context);
    SIZE(hgrid_shapes);
    OFFSET(hgrid_shapes, opaque);
    SIZE(hgrid_instance);
    OFFSET(hgrid_instance, linear);
    OFFSET(hgrid_instance, object);
    OFFSET(hgrid_instance, translation);
    OFFSET(hgrid_instance, mask);
    OFFSET(hgrid_instance, id);
    SIZE(hgrid_object);
    OFFSET(hgrid_object, opaque);
    SIZE(hgrid_scene);
    OFFSET(hgrid_scene, opaque);
    SIZE(hgrid_ray_f64);
    OFFSET(hgrid_ray_f64, origin);
    OFFSET(hgrid_ray_f64, direction);
    OFFSET(hgrid_ray_f64, t_min);
    OFFSET(hgrid_ray_f64, t_max);
    OFFSET(hgrid_ray_f64, reserved);
    SIZE(hgrid_scene_hit);
    OFFSET(hgrid_scene_hit, t);
    OFFSET(hgrid_scene_hit, u);
    OFFSET(hgrid_scene_hit, v);
    OFFSET(hgrid_scene_hit, primitive);
    OFFSET(hgrid_scene_hit, path);
    SIZE(hgrid_scene_surface);
    OFFSET(hgrid_scene_surface, position);
    OFFSET(hgrid_scene_surface, above);
    OFFSET(hgrid_scene_surface, below);
    OFFSET(hgrid_scene_surface, normal);
    OFFSET(hgrid_scene_surface, is_front);
    SIZE(hgrid_scene_options);
    OFFSET(hgrid_scene_options, struct_size);
    OFFSET(hgrid_scene_options, mask);
    OFFSET(hgrid_scene_options, cull);
    OFFSET(hgrid_scene_options, filter_mask);
    OFFSET(hgrid_scene_options, context);
    OFFSET(hgrid_scene_options, filter);
    OFFSET(hgrid_scene_options, counters);
    OFFSET(hgrid_scene_options, scratch);
    OFFSET(hgrid_scene_options, scratch_bytes);
    SIZE(hgrid_allocator);
    OFFSET(hgrid_allocator, struct_size);
    OFFSET(hgrid_allocator, reserved);
    OFFSET(hgrid_allocator, context);
    OFFSET(hgrid_allocator, allocate);
    OFFSET(hgrid_allocator, release);
}

static void constants(void)
{
    NUMBER(HGRID_ALIGNMENT);
    NUMBER(HGRID_INVALID_ID);
    NUMBER(HGRID_BLOB_VERSION);
    NUMBER(HGRID_INDEX_U32);
    NUMBER(HGRID_INDEX_U16);
    NUMBER(HGRID_METHOD_ONE_LEVEL);
    NUMBER(HGRID_METHOD_FIXED);
    NUMBER(HGRID_METHOD_VARIABLE);
    NUMBER(HGRID_METHOD_RECURSIVE);
    NUMBER(HGRID_METHOD_BVH);
    NUMBER(HGRID_CONTENT_TRIANGLES);
    NUMBER(HGRID_CONTENT_SHAPES);
    NUMBER(HGRID_CONTENT_INSTANCES);
    NUMBER(HGRID_CONTENT_PACKED_SCENE);
    NUMBER(HGRID_QUALITY_FAST);
    NUMBER(HGRID_QUALITY_HIGH);
    NUMBER(HGRID_MAX_DEPTH);
    NUMBER(HGRID_MAX_NESTING);
    NUMBER(HGRID_BUILD_STRICT);
    NUMBER(HGRID_MAX_TASKS);
    NUMBER(HGRID_PROGRESS_END);
    NUMBER(HGRID_CULL_NONE);
    NUMBER(HGRID_CULL_BACK);
    NUMBER(HGRID_CULL_FRONT);
    NUMBER(HGRID_REJECT);
    NUMBER(HGRID_ACCEPT);
    NUMBER(HGRID_ACCEPT_AND_STOP);
    NUMBER(HGRID_COHERENCE_INCOHERENT);
    NUMBER(HGRID_COHERENCE_COHERENT);
    NUMBER(HGRID_OK);
    NUMBER(HGRID_ERROR_NULL_ARGUMENT);
    NUMBER(HGRID_ERROR_STRUCT_SIZE);
    NUMBER(HGRID_ERROR_MISALIGNED);
    NUMBER(HGRID_ERROR_OVERLAP);
    NUMBER(HGRID_ERROR_INDEX_TOO_SMALL);
    NUMBER(HGRID_ERROR_SCRATCH_TOO_SMALL);
    NUMBER(HGRID_ERROR_OUT_OF_MEMORY);
    NUMBER(HGRID_ERROR_INVALID_POSITIONS);
    NUMBER(HGRID_ERROR_INVALID_INDICES);
    NUMBER(HGRID_ERROR_INVALID_INDEX_TYPE);
    NUMBER(HGRID_ERROR_TOO_MANY_TRIANGLES);
    NUMBER(HGRID_ERROR_INDEX_OUT_OF_RANGE);
    NUMBER(HGRID_ERROR_NON_FINITE);
    NUMBER(HGRID_ERROR_INVALID_MASKS);
    NUMBER(HGRID_ERROR_INVALID_PARTS);
    NUMBER(HGRID_ERROR_INVALID_METHOD);
    NUMBER(HGRID_ERROR_INVALID_DENSITY);
    NUMBER(HGRID_ERROR_INVALID_FLAGS);
    NUMBER(HGRID_ERROR_INVALID_MACROCELL_FACTOR);
    NUMBER(HGRID_ERROR_INVALID_DEPTH);
    NUMBER(HGRID_ERROR_PARALLEL_FOR);
    NUMBER(HGRID_ERROR_CANCELLED);
    NUMBER(HGRID_ERROR_METHOD_LEFT_OUT);
    NUMBER(HGRID_ERROR_INVALID_QUALITY);
    NUMBER(HGRID_ERROR_NOT_A_GRID);
    NUMBER(HGRID_ERROR_WRONG_BYTE_ORDER);
    NUMBER(HGRID_ERROR_UNSUPPORTED_VERSION);
    NUMBER(HGRID_ERROR_TRUNCATED);
    NUMBER(HGRID_ERROR_MESH_MISMATCH);
    NUMBER(HGRID_ERROR_CORRUPT);
    NUMBER(HGRID_ERROR_NO_MESH);
    NUMBER(HGRID_ERROR_CANNOT_REFIT);
    NUMBER(HGRID_ERROR_METHOD_REMOVED);
    NUMBER(HGRID_ERROR_OTHER_CONTENT);
    NUMBER(HGRID_ERROR_INVALID_RAYS);
    NUMBER(HGRID_ERROR_INVALID_ANSWERS);
    NUMBER(HGRID_ERROR_INVALID_COHERENCE);
    NUMBER(HGRID_ERROR_INVALID_CULL);
    NUMBER(HGRID_ERROR_INSTANCE_OBJECT);
    NUMBER(HGRID_ERROR_INSTANCE_MATRIX);
    NUMBER(HGRID_ERROR_MISSING_OBJECTS);
    NUMBER(HGRID_ERROR_TOO_DEEP);
}

static void versions(void)
{
    printf("macros %d.%d.%d\n", HGRID_VERSION_MAJOR, HGRID_VERSION_MINOR, HGRID_VERSION_PATCH);
    printf("macro %lu\n", (unsigned long)HGRID_VERSION);
    printf("text %s\n", HGRID_VERSION_STRING);
    printf("function %lu\n", (unsigned long)hgrid_version());
    printf("function_text %s\n", hgrid_version_string());
}

/* Prints the values that each _INIT macro sets, one "name struct_size and the other fields" a line. */
static void defaults(void)
{
    const hgrid_mesh m = HGRID_MESH_INIT;
    const hgrid_config configs[] = {HGRID_CONFIG_INIT_ONE_LEVEL, HGRID_CONFIG_INIT_FIXED,
                                    HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE,
                                    HGRID_CONFIG_INIT_BVH, HGRID_CONFIG_INIT};
    const hgrid_query_options o = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_report r = HGRID_REPORT_INIT;
    const hgrid_blob_info b = HGRID_BLOB_INFO_INIT;
    const hgrid_refit_report f = HGRID_REFIT_REPORT_INIT;
    const hgrid_statistics s = HGRID_STATISTICS_INIT;
    const hgrid_allocator a = HGRID_ALLOCATOR_INIT;
    const hgrid_boxes x = HGRID_BOXES_INIT;
    const hgrid_scene_options n = HGRID_SCENE_OPTIONS_INIT;
    printf("boxes %lu %lu %d %zu %zu %d %zu %d %d\n", (unsigned long)x.struct_size, (unsigned long)x.reserved,
           x.boxes != NULL, x.box_stride, x.count, x.masks != NULL, x.mask_stride, x.test != NULL,
           x.context != NULL);
    printf("scene_options %lu %#lx %lu %lu %d %d %d %d %zu\n", (unsigned long)n.struct_size,
           (unsigned long)n.mask, (unsigned long)n.cull, (unsigned long)n.filter_mask, n.context != NULL,
           n.filter != NULL, n.counters != NULL, n.scratch != NULL, n.scratch_bytes);
    printf("mesh %lu %lu %d %zu %zu %d %zu %zu %d %zu %d %zu\n", (unsigned long)m.struct_size,
           (unsigned long)m.index_type, m.positions != NULL, m.position_stride, m.vertex_count,
           m.indices != NULL, m.index_stride, m.triangle_count, m.masks != NULL, m.mask_stride,
           m.parts != NULL, m.part_count);
    printf("query_options %lu %#lx %lu %#lx %d %d %d %d %zu %lu %lu\n", (unsigned long)o.struct_size,
           (unsigned long)o.mask, (unsigned long)o.cull, (unsigned long)o.skip, o.context != NULL,
           o.filter != NULL, o.counters != NULL, o.scratch != NULL, o.scratch_bytes,
           (unsigned long)o.filter_mask, (unsigned long)o.reserved);
    printf("report %lu %lu %llu %llu %#lx %lu %lu %g %lu %lu %lu %lu\n",
           (unsigned long)r.struct_size, (unsigned long)r.is_exact,
           (unsigned long long)r.index_bytes, (unsigned long long)r.scratch_bytes,
           (unsigned long)r.triangle, (unsigned long)r.skipped_count,
           (unsigned long)r.reference_count, (double)r.density, (unsigned long)r.resolution[0],
           (unsigned long)r.resolution[1], (unsigned long)r.resolution[2],
           (unsigned long)r.reserved);
    printf("refit_report %lu %#lx %g %g\n", (unsigned long)f.struct_size,
           (unsigned long)f.triangle, f.cost_before, f.cost_after);
    printf("blob_info %lu %lu %lu %lu %llu %llu %llu %llu %lu %lu\n", (unsigned long)b.struct_size,
           (unsigned long)b.version, (unsigned long)b.method, (unsigned long)b.has_mesh,
           (unsigned long long)b.vertex_count, (unsigned long long)b.triangle_count,
           (unsigned long long)b.grid_bytes, (unsigned long long)b.total_bytes,
           (unsigned long)b.content, (unsigned long)b.reserved);
    printf("statistics %lu %lu %lu %#lx %llu %llu %lu %lu %llu\n", (unsigned long)s.struct_size,
           (unsigned long)s.skipped_count, (unsigned long)s.degenerate_count,
           (unsigned long)s.first_bad, (unsigned long long)s.list_count,
           (unsigned long long)s.reference_count, (unsigned long)s.longest_list,
           (unsigned long)s.reserved, (unsigned long long)s.content_hash);
    printf("allocator %lu %lu %d %d %d\n", (unsigned long)a.struct_size, (unsigned long)a.reserved,
           a.context != NULL, a.allocate != NULL, a.release != NULL);
    for (size_t i = 0; i < sizeof configs / sizeof *configs; i++) {
        const hgrid_config *c = &configs[i];
        printf("config_%lu %lu %g %lu %lu %lu %lu %lu %lu %lu %d %d %d\n", (unsigned long)c->method,
               (unsigned long)c->struct_size, (double)c->density,
               (unsigned long)c->macrocell_factor, (unsigned long)c->subdivide_above,
               (unsigned long)c->depth, (unsigned long)c->reserved, (unsigned long)c->flags,
               (unsigned long)c->tasks, (unsigned long)c->quality, c->context != NULL,
               c->run != NULL, c->progress != NULL);
    }
}

static void bounds(void)
{
    unsigned long count;
    for (count = 0; count < 3000; count++)
        BOUNDS(count);
    for (; count < 4000000000UL; count += count / 7)
        BOUNDS(count);
    BOUNDS(4294967294UL);
}

int main(void)
{
    layout();
    constants();
    versions();
    defaults();
    bounds();
    return 0;
}
