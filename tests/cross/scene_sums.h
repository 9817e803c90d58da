/* A part of sums.c: shapes, and scenes of instances. */

enum { SHAPES = 40, INNER = 12, OUTER = 30, SLICE = 32 << 10 };

static float boxes[SHAPES][6];
static hgrid_ray_f64 wide_rays[RAYS];
static hgrid_scene_hit scene_hits[RAYS];

static uint64_t bits_of_double(double value)
{
    union {
        uint64_t bits;
        double value;
    } both;
    both.value = value;
    return both.bits;
}

/* The test of a shape: a plate across z, in the middle of its box and a little smaller. Every result has a variable of
 * its own, which rounds it to float also where the processor keeps more digits. */
static bool meet_plate(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    const float *box = boxes[shape];
    const float twice = box[2] + box[5], middle = twice / 2, away = middle - ray->origin[2];
    const float t = ray->direction[2] != 0 ? away / ray->direction[2] : -1;
    (void)context;
    if (!(t >= ray->t_min && t <= ray->t_max))
        return false;
    for (int axis = 0; axis < 2; axis++) {
        const float low = box[axis] + 0.00390625f, high = box[axis + 3] - 0.00390625f;
        const float moved = t * ray->direction[axis], at = ray->origin[axis] + moved;
        if (at < low || at > high)
            return false;
    }
    hit->t = t, hit->u = 0.25f, hit->v = 0.5f;
    return true;
}

/* Makes an instance with one of six matrices: also a rotation, a mirror, a scale and a shear. */
static hgrid_instance make_instance(uint32_t object, double offset)
{
    static const float matrices[6][3][3] = {
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},    {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}},
        {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}},   {{2, 0, 0}, {0, 0.5f, 0}, {0, 0, 1}},
        {{1, 0.5f, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 0, 1}, {0, 0.75f, 0}, {1, 0, 0}},
    };
    hgrid_instance made = HGRID_INSTANCE_INIT;
    const uint32_t matrix = random_below(COUNT(matrices));
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++)
            made.linear[row][column] = matrices[matrix][row][column];
        made.translation[row] = (double)random_below(3072) / 1024 - 1;
    }
    made.translation[0] += offset;
    made.object = object, made.mask = 1u << random_below(5);
    return made;
}

/* Adds the hit of a ray in a scene, its surface, and what is at the end of its path. */
static void add_scene_hit(const hgrid_scene *scene, uint32_t ray, const hgrid_scene_hit *hit)
{
    hgrid_scene_surface at;
    hgrid_instance instance = HGRID_INSTANCE_INIT;
    add(ray), add_floats(&hit->t, 1), add_floats(&hit->u, 1), add_floats(&hit->v, 1), add(hit->primitive);
    for (int level = 0; level < HGRID_MAX_NESTING; level++)
        add(hit->path[level]);
    add(hgrid_scene_locate(scene, hit, &instance, NULL));
    add(instance.object), add(instance.mask), add_floats(instance.linear[0], 9);
    if (hgrid_scene_surface_at(scene, &wide_rays[ray], hit, &at)) {
        add_floats(at.normal, 3), add(at.is_front);
        for (int axis = 0; axis < 3; axis++)
            add(bits_of_double(at.position[axis])), add(bits_of_double(at.above[axis])),
                add(bits_of_double(at.below[axis]));
    }
}

/* Asks a scene for all rays: one after the other, then together. */
static int ask_scene(const hgrid_scene *scene, const char *name)
{
    static const char *const names[] = {"batch", "sorted", "batch-culled"};
    hgrid_scene_options with = HGRID_SCENE_OPTIONS_INIT;
    hgrid_scene_hit hit;
    start();
    for (uint32_t i = 0; i < RAYS; i++)
        if (hgrid_intersect_scene(scene, &wide_rays[i], NULL, &hit))
            add_scene_hit(scene, i, &hit);
    say("large", name, "closest", sum);
    start();
    for (int i = 0; i < RAYS; i++)
        add(hgrid_occluded_scene(scene, &wide_rays[i], NULL));
    say("large", name, "any", sum);
    for (int round = 0; round < 3; round++) {
        const hgrid_coherence how =
            round == 1 ? HGRID_COHERENCE_INCOHERENT : HGRID_COHERENCE_COHERENT;
        with.scratch = round == 1 ? sorting : NULL;
        with.scratch_bytes = round == 1 ? sizeof sorting : 0;
        with.mask = round == 2 ? 0x15 : UINT32_MAX;
        with.cull = round == 2 ? HGRID_CULL_BACK : HGRID_CULL_NONE;
        if (hgrid_intersect_scene_n(scene, wide_rays, 0, scene_hits, 0, RAYS, how, &with) != HGRID_OK)
            return 10 + round;
        start();
        for (uint32_t i = 0; i < RAYS; i++)
            if (scene_hits[i].primitive != HGRID_INVALID_ID)
                add_scene_hit(scene, i, &scene_hits[i]);
        say("large", name, names[round], sum);
    }
    if (hgrid_occluded_scene_n(scene, wide_rays, 0, occluded, 0, RAYS, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
        return 20;
    start();
    for (int i = 0; i < RAYS; i++)
        add(occluded[i]);
    say("large", name, "batch-any", sum);
    return 0;
}

/* A tree of shapes alone, then scenes of the mesh, of the shapes and of another scene, a million units from 0. */
static int ask_scenes(void)
{
    static hgrid_instance instances[OUTER];
    const double far_away = 1048576;
    unsigned char *const of_shapes = packed, *const of_inner = packed + SLICE, *const of_outer = packed + 2 * SLICE;
    hgrid_mesh mesh = HGRID_MESH_INIT;
    hgrid_boxes plates = HGRID_BOXES_INIT;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_refit_report told = HGRID_REFIT_REPORT_INIT;
    hgrid_object objects[3];
    hgrid_grid grid;
    hgrid_shapes shapes;
    hgrid_scene inner, outer;
    hgrid_hit hit;
    make_mesh(5);
    mesh.positions = positions, mesh.vertex_count = VERTICES;
    mesh.indices = indices, mesh.triangle_count = TRIANGLES, mesh.index_type = HGRID_INDEX_U16;
    mesh.masks = masks;
    state = 9;
    for (int i = 0; i < SHAPES; i++)
        for (int axis = 0; axis < 3; axis++) {
            boxes[i][axis] = (float)random_below(1024) / 1024;
            boxes[i][axis + 3] = boxes[i][axis] + (float)(64 + random_below(192)) / 1024;
        }
    plates.boxes = boxes, plates.count = SHAPES, plates.test = meet_plate;
    if (hgrid_build(&mesh, NULL, index_region, sizeof index_region, scratch, sizeof scratch, &grid, NULL) != HGRID_OK)
        return 1;
    if (hgrid_build_shapes(&plates, NULL, of_shapes, SLICE, scratch, sizeof scratch, &shapes, &report) != HGRID_OK)
        return 2;

    start();
    add(report.index_bytes);
    for (int i = 0; i < RAYS; i++)
        if (hgrid_intersect_shapes(&shapes, &rays[i], NULL, &hit))
            add((uint64_t)i), add_hit(&hit);
    if (hgrid_intersect_shapes_n(&shapes, rays, 0, hits, 0, RAYS, HGRID_COHERENCE_INCOHERENT, NULL) != HGRID_OK)
        return 3;
    for (int i = 0; i < RAYS; i++)
        if (hits[i].primitive != HGRID_INVALID_ID)
            add((uint64_t)i), add_hit(&hits[i]);
    say("large", "shapes", "closest", sum);

    if (hgrid_object_grid(&grid, &objects[0]) != HGRID_OK || hgrid_object_shapes(&shapes, &objects[1]) != HGRID_OK)
        return 4;
    for (uint32_t i = 0; i < INNER; i++)
        instances[i] = make_instance(i % 2, 0);
    if (hgrid_build_scene(instances, INNER, objects, 2, NULL, of_inner, SLICE, scratch, sizeof scratch, &inner,
                          &report) != HGRID_OK)
        return 5;
    start();
    add(report.index_bytes);
    if (hgrid_object_scene(&inner, &objects[2]) != HGRID_OK)
        return 6;
    for (uint32_t i = 0; i < OUTER; i++)
        instances[i] = make_instance(i % 3, far_away);
    if (hgrid_build_scene(instances, OUTER, objects, 3, NULL, of_outer, SLICE, scratch, sizeof scratch, &outer,
                          &report) != HGRID_OK)
        return 7;
    add(report.index_bytes);
    add((uint64_t)hgrid_validate_scene(&outer, scratch, sizeof scratch));
    say("large", "scene", "build", sum);

    for (int i = 0; i < RAYS; i++) {
        hgrid_ray_f64 *wide = &wide_rays[i];
        wide->t_min = rays[i].t_min, wide->t_max = rays[i].t_max;
        for (int axis = 0; axis < 3; axis++) {
            wide->origin[axis] = (double)rays[i].origin[axis] + (axis == 0 ? far_away : 0);
            wide->direction[axis] = rays[i].direction[axis];
        }
    }
    const int failure = ask_scene(&outer, "scene");
    if (failure)
        return failure;
    for (uint32_t i = 0; i < OUTER; i++)
        instances[i] = make_instance(i % 3, far_away);
    if (hgrid_refit_scene(instances, OUTER, objects, 3, of_outer, (size_t)report.index_bytes, &outer, &told) !=
        HGRID_OK)
        return 8;
    return ask_scene(&outer, "scene-refit");
}
