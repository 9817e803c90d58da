/*
 * hgrid for C++14 and later: hgrid.h with types that own, know their size and call lambdas. From C++17
 * on optional and byte are those of the standard library.
 *
 * It adds no code of its own to a query: most functions are the C call of the same name, and the
 * manual is hgrid.h. What it adds is for the programmer:
 *
 *   hgrid::grid       a built grid, by default a tree, that owns its memory, and its mesh if it is
 *                     moved in; moves, frees itself
 *   hgrid::view       a grid in memory of yours: an arena, a mapped file; hgrid_grid in C
 *   hgrid::mesh       your vertices and indices, in structs of any kind
 *   hgrid::config     the settings of a build; progress and parallel_for are callables of yours
 *   hgrid::options    the options of a query; a filter is any callable, without allocation
 *   hgrid::result     a value, or the status that says why there is none
 *   hgrid::strided    rays and hits inside your structs: hgrid::field(pixels, &pixel::ray)
 *   hgrid::memory     bytes for an index, a scratch or a blob that free themselves
 *   hgrid::boxes      the boxes of shapes of your own, and the test for them
 *   hgrid::shapes     a tree of such shapes, in memory of yours
 *   hgrid::scene      a tree of instances of grids, shapes and scenes, in memory of yours
 *
 *   #include <hgrid.hpp>
 *   #include <cstdio>
 *   #include <vector>
 *
 *   struct vertex { float x, y, z, s, t; };
 *
 *   int main()
 *   {
 *       const std::vector<vertex> vertices = {{0, 0, 0, 0, 0}, {1, 0, 0, 1, 0}, {0, 1, 0, 0, 1}};
 *       const std::vector<std::uint16_t> indices = {0, 1, 2};
 *       const auto grid = hgrid::grid::build(hgrid::mesh(vertices, indices));
 *       if (!grid)
 *           return std::puts(hgrid::message(grid.error())), 1;
 *       if (const auto hit = grid->intersect(hgrid::make_ray({0.25f, 0.25f, 1}, {0, 0, -1})))
 *           std::printf("triangle %u at t = %g\n", hit->primitive, hit->t);
 *   }
 *
 * Exceptions: none are thrown, and none are needed (-fno-exceptions is fine, -fno-rtti, too). Every
 * function is noexcept. An exception that leaves a callable of yours ends the program, because it cannot
 * pass through C.
 *
 * Lifetimes: meshes, boxes, views, scenes, options and configurations refer to what they were given:
 * arrays, blobs, objects, counters, callables. All of these must have a name, so that they are still
 * there when they are used. The compiler refuses most temporaries, but not all: see docs/cpp.md.
 *
 * Threads: as in hgrid.h. Any number of threads may query one grid or view.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */

#ifndef HGRID_HPP
#define HGRID_HPP

#include "hgrid.h"

#if defined(_MSVC_LANG)
#define HGRID_CPP _MSVC_LANG
#else
#define HGRID_CPP __cplusplus
#endif
#if HGRID_CPP < 201402L
#error "hgrid.hpp needs C++14"
#endif
#if HGRID_CPP >= 201703L
#define HGRID_INLINE inline
#define HGRID_NODISCARD [[nodiscard]]
#else
#define HGRID_INLINE
#define HGRID_NODISCARD
#endif

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#if HGRID_CPP >= 201703L
#include <optional>
#endif

/// See the head of this file.
namespace hgrid {
#if HGRID_CPP < 201703L
// Under another name for the linker than where these are the types of C++17.
inline namespace cpp14 {
#endif

// --- types ----------------------------------------------------------------------------------------

/// A ray, or the part of it from `t_min` to `t_max`. See `hgrid_ray`.
using ray = ::hgrid_ray;
/// A ray whose origin is in double. See `hgrid_ray_f64`.
using ray_f64 = ::hgrid_ray_f64;
/// The hit of a ray on a triangle. See `hgrid_hit`.
using hit = ::hgrid_hit;
/// The nearest point of a mesh. See `hgrid_closest`.
using closest = ::hgrid_closest;
/// Work done by queries. See `hgrid_counters`: it begins as `{}`.
using counters = ::hgrid_counters;
/// Memory for one of the meshes that `mesh::join` joins. See `hgrid_part`.
using part = ::hgrid_part;
/// A point of a mesh where a ray met it. See `hgrid_surface`.
using surface = ::hgrid_surface;
/// A point of a scene where a ray met a triangle. See `hgrid_scene_surface`.
using scene_surface = ::hgrid_scene_surface;
/// The report of a build. See `hgrid_report`.
struct report : ::hgrid_report {
    /// An empty report.
    report() noexcept : ::hgrid_report HGRID_REPORT_INIT {}
    /// One that a call in C has filled.
    report(const ::hgrid_report &raw) noexcept : ::hgrid_report(raw) {}
};
/// The statistics of a grid and its mesh. See `hgrid_statistics`.
using statistics = ::hgrid_statistics;
/// The report of a refit. See `hgrid_refit_report`.
struct refit_report : ::hgrid_refit_report {
    /// An empty report.
    refit_report() noexcept : ::hgrid_refit_report HGRID_REFIT_REPORT_INIT {}
    /// One that a call in C has filled.
    refit_report(const ::hgrid_refit_report &raw) noexcept : ::hgrid_refit_report(raw) {}
};
/// The contents of a blob's header. See `hgrid_blob_info`; its numbers are those of the enumerations here:
/// `static_cast<hgrid::content>(info.content)`.
using blob_info = ::hgrid_blob_info;
/// A point or a direction: x, y, z.
using point = std::array<float, 3>;

/// The id that no triangle has; in a hit of a batch, a miss.
HGRID_INLINE constexpr std::uint32_t invalid_id = HGRID_INVALID_ID;
/// The alignment, in bytes, of every blob and index, of the views of a packed scene, and of the scratch of builds,
/// `sizes` and `fit`. See `HGRID_ALIGNMENT`.
HGRID_INLINE constexpr std::size_t alignment = HGRID_ALIGNMENT;

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#endif
/// Bytes of index that are enough for any mesh with so many triangles and the default configuration,
/// for an array.
inline constexpr std::size_t index_bound(std::size_t triangles) noexcept
{
    return HGRID_INDEX_BOUND(triangles);
}
/// Bytes of scratch that are enough for any mesh with so many triangles and the default configuration.
inline constexpr std::size_t scratch_bound(std::size_t triangles) noexcept
{
    return HGRID_SCRATCH_BOUND(triangles);
}
/// The same with `method::one_level`: bytes of index.
inline constexpr std::size_t one_level_index_bound(std::size_t triangles) noexcept
{
    return HGRID_INDEX_BOUND_ONE_LEVEL(triangles);
}
/// The same with `method::one_level`, bytes of scratch.
inline constexpr std::size_t one_level_scratch_bound(std::size_t triangles) noexcept
{
    return HGRID_SCRATCH_BOUND_ONE_LEVEL(triangles);
}
/// The same with `quality::high`, bytes of scratch.
inline constexpr std::size_t bvh_high_scratch_bound(std::size_t triangles) noexcept
{
    return HGRID_BVH_HIGH_SCRATCH_BOUND(triangles);
}
/// Bytes of scratch that are enough for `validate` of a view, of shapes or of a scene, with so many triangles, shapes
/// or instances.
inline constexpr std::size_t validate_bound(std::size_t triangles) noexcept
{
    return HGRID_VALIDATE_BOUND(triangles);
}
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/// The answer of a call: `ok`, or why not. The numbers are those of `hgrid_status`, and a later library
/// may return others than these.
enum class HGRID_NODISCARD status : std::int32_t {
    /// `HGRID_OK`
    ok = HGRID_OK,
    /// `HGRID_ERROR_NULL_ARGUMENT`
    null_argument = HGRID_ERROR_NULL_ARGUMENT,
    /// `HGRID_ERROR_STRUCT_SIZE`
    struct_size = HGRID_ERROR_STRUCT_SIZE,
    /// `HGRID_ERROR_MISALIGNED`
    misaligned = HGRID_ERROR_MISALIGNED,
    /// `HGRID_ERROR_OVERLAP`
    overlap = HGRID_ERROR_OVERLAP,
    /// `HGRID_ERROR_INDEX_TOO_SMALL`
    index_too_small = HGRID_ERROR_INDEX_TOO_SMALL,
    /// `HGRID_ERROR_SCRATCH_TOO_SMALL`
    scratch_too_small = HGRID_ERROR_SCRATCH_TOO_SMALL,
    /// `HGRID_ERROR_OUT_OF_MEMORY`
    out_of_memory = HGRID_ERROR_OUT_OF_MEMORY,
    /// `HGRID_ERROR_INVALID_POSITIONS`
    invalid_positions = HGRID_ERROR_INVALID_POSITIONS,
    /// `HGRID_ERROR_INVALID_INDICES`
    invalid_indices = HGRID_ERROR_INVALID_INDICES,
    /// `HGRID_ERROR_INVALID_INDEX_TYPE`
    invalid_index_type = HGRID_ERROR_INVALID_INDEX_TYPE,
    /// `HGRID_ERROR_TOO_MANY_TRIANGLES`
    too_many_triangles = HGRID_ERROR_TOO_MANY_TRIANGLES,
    /// `HGRID_ERROR_INDEX_OUT_OF_RANGE`
    index_out_of_range = HGRID_ERROR_INDEX_OUT_OF_RANGE,
    /// `HGRID_ERROR_NON_FINITE`
    non_finite = HGRID_ERROR_NON_FINITE,
    /// `HGRID_ERROR_INVALID_MASKS`
    invalid_masks = HGRID_ERROR_INVALID_MASKS,
    /// `HGRID_ERROR_INVALID_PARTS`
    invalid_parts = HGRID_ERROR_INVALID_PARTS,
    /// `HGRID_ERROR_INVALID_METHOD`
    invalid_method = HGRID_ERROR_INVALID_METHOD,
    /// `HGRID_ERROR_INVALID_DENSITY`
    invalid_density = HGRID_ERROR_INVALID_DENSITY,
    /// `HGRID_ERROR_INVALID_FLAGS`
    invalid_flags = HGRID_ERROR_INVALID_FLAGS,
    /// `HGRID_ERROR_INVALID_MACROCELL_FACTOR`
    invalid_macrocell_factor = HGRID_ERROR_INVALID_MACROCELL_FACTOR,
    /// `HGRID_ERROR_INVALID_DEPTH`
    invalid_depth = HGRID_ERROR_INVALID_DEPTH,
    /// `HGRID_ERROR_PARALLEL_FOR`
    parallel_for = HGRID_ERROR_PARALLEL_FOR,
    /// `HGRID_ERROR_CANCELLED`
    cancelled = HGRID_ERROR_CANCELLED,
    /// `HGRID_ERROR_METHOD_LEFT_OUT`
    method_left_out = HGRID_ERROR_METHOD_LEFT_OUT,
    /// `HGRID_ERROR_INVALID_QUALITY`
    invalid_quality = HGRID_ERROR_INVALID_QUALITY,
    /// `HGRID_ERROR_NOT_A_GRID`
    not_a_grid = HGRID_ERROR_NOT_A_GRID,
    /// `HGRID_ERROR_WRONG_BYTE_ORDER`
    wrong_byte_order = HGRID_ERROR_WRONG_BYTE_ORDER,
    /// `HGRID_ERROR_UNSUPPORTED_VERSION`
    unsupported_version = HGRID_ERROR_UNSUPPORTED_VERSION,
    /// `HGRID_ERROR_TRUNCATED`
    truncated = HGRID_ERROR_TRUNCATED,
    /// `HGRID_ERROR_MESH_MISMATCH`
    mesh_mismatch = HGRID_ERROR_MESH_MISMATCH,
    /// `HGRID_ERROR_CORRUPT`
    corrupt = HGRID_ERROR_CORRUPT,
    /// `HGRID_ERROR_NO_MESH`
    no_mesh = HGRID_ERROR_NO_MESH,
    /// `HGRID_ERROR_CANNOT_REFIT`
    cannot_refit = HGRID_ERROR_CANNOT_REFIT,
    /// `HGRID_ERROR_METHOD_REMOVED`
    method_removed = HGRID_ERROR_METHOD_REMOVED,
    /// `HGRID_ERROR_OTHER_CONTENT`
    other_content = HGRID_ERROR_OTHER_CONTENT,
    /// `HGRID_ERROR_INSTANCE_OBJECT`
    instance_object = HGRID_ERROR_INSTANCE_OBJECT,
    /// `HGRID_ERROR_INSTANCE_MATRIX`
    instance_matrix = HGRID_ERROR_INSTANCE_MATRIX,
    /// `HGRID_ERROR_MISSING_OBJECTS`
    missing_objects = HGRID_ERROR_MISSING_OBJECTS,
    /// `HGRID_ERROR_TOO_DEEP`
    too_deep = HGRID_ERROR_TOO_DEEP,
    /// `HGRID_ERROR_INVALID_RAYS`
    invalid_rays = HGRID_ERROR_INVALID_RAYS,
    /// `HGRID_ERROR_INVALID_ANSWERS`
    invalid_answers = HGRID_ERROR_INVALID_ANSWERS,
    /// `HGRID_ERROR_INVALID_COHERENCE`
    invalid_coherence = HGRID_ERROR_INVALID_COHERENCE,
    /// `HGRID_ERROR_INVALID_CULL`
    invalid_cull = HGRID_ERROR_INVALID_CULL,
};

/// Says in words what a status means and what to do. Static, never null.
inline const char *message(status of) noexcept
{
    return ::hgrid_status_string(static_cast<::hgrid_status>(of));
}

namespace detail {
inline status said(::hgrid_status of) noexcept
{
    return static_cast<status>(of);
}
} // namespace detail

/// The structure to build; `hgrid.h` says when to choose which.
enum class method : std::uint32_t {
    /// `HGRID_METHOD_ONE_LEVEL`
    one_level = HGRID_METHOD_ONE_LEVEL,
    /// `HGRID_METHOD_FIXED`
    fixed = HGRID_METHOD_FIXED,
    /// `HGRID_METHOD_VARIABLE`
    variable = HGRID_METHOD_VARIABLE,
    /// `HGRID_METHOD_RECURSIVE`
    recursive = HGRID_METHOD_RECURSIVE,
    /// `HGRID_METHOD_BVH`
    bvh = HGRID_METHOD_BVH,
};

/// Says what you know about the rays of a batch, and so in which order they are traced. It changes how
/// fast the answers come, never the answers.
enum class coherence : std::uint32_t {
    /// Nothing, they may be sorted: `HGRID_COHERENCE_INCOHERENT`
    incoherent = HGRID_COHERENCE_INCOHERENT,
    /// Neighbours follow one another, as given: `HGRID_COHERENCE_COHERENT`
    coherent = HGRID_COHERENCE_COHERENT,
};

/// How much time a build of `method::bvh` spends on faster rays.
enum class quality : std::uint32_t {
    /// The shortest build: `HGRID_QUALITY_FAST`
    fast = HGRID_QUALITY_FAST,
    /// A longer build, after which most rays are faster: `HGRID_QUALITY_HIGH`
    high = HGRID_QUALITY_HIGH,
};

/// Triangles that are not hit from one of their sides.
enum class culling : std::uint32_t {
    /// Both sides are hit: `HGRID_CULL_NONE`
    none = HGRID_CULL_NONE,
    /// Backs are not hit: `HGRID_CULL_BACK`
    back = HGRID_CULL_BACK,
    /// Fronts are not hit: `HGRID_CULL_FRONT`
    front = HGRID_CULL_FRONT,
};

/// The things that a blob can be built over. `blob_info::content` holds the number of one of them.
enum class content : std::uint32_t {
    /// The triangles of a mesh, for `view::open`: `HGRID_CONTENT_TRIANGLES`
    triangles = HGRID_CONTENT_TRIANGLES,
    /// Shapes, for `shapes::open`: `HGRID_CONTENT_SHAPES`
    shapes = HGRID_CONTENT_SHAPES,
    /// Instances, for `scene::open`: `HGRID_CONTENT_INSTANCES`
    instances = HGRID_CONTENT_INSTANCES,
    /// A scene with all that it shows, for `scene::open_packed`: `HGRID_CONTENT_PACKED_SCENE`
    packed_scene = HGRID_CONTENT_PACKED_SCENE,
};

/// The answer of a filter about a hit.
enum class verdict : ::hgrid_verdict {
    /// As if the triangle were not there: `HGRID_REJECT`
    reject = HGRID_REJECT,
    /// This hit counts: `HGRID_ACCEPT`
    accept = HGRID_ACCEPT,
    /// This hit counts, and no other one will: `HGRID_ACCEPT_AND_STOP`
    accept_and_stop = HGRID_ACCEPT_AND_STOP,
};

/// A ray from a point; `t` counts multiples of the direction, whatever its length.
inline constexpr ray make_ray(const point &origin, const point &direction, float t_min = 0,
                              float t_max = std::numeric_limits<float>::infinity()) noexcept
{
    return {{origin[0], origin[1], origin[2]},
            t_min,
            {direction[0], direction[1], direction[2]},
            t_max};
}

/// A ray from a point in double, for queries of scenes: `make_ray`.
inline constexpr ray_f64 make_ray_f64(const std::array<double, 3> &origin, const point &direction, float t_min = 0,
                                      float t_max = std::numeric_limits<float>::infinity()) noexcept
{
    return {{origin[0], origin[1], origin[2]},
            {direction[0], direction[1], direction[2]},
            t_min,
            t_max,
            0};
}

/// Returns true if the library that is linked has the major and minor version of this header. The patch number may
/// differ.
inline bool is_compatible() noexcept
{
    return ::hgrid_version() >> 8 == HGRID_VERSION >> 8;
}

/// Returns true if the library that is linked has a method: it may have been built with fewer, to be smaller.
inline bool has_method(method which) noexcept
{
    return ::hgrid_has_method(static_cast<std::uint32_t>(which));
}

// --- a value or nothing, bytes --------------------------------------------------------------------

#if HGRID_CPP >= 201703L
/// A value, or nothing: that of the standard library.
template <class T>
using optional = std::optional<T>;
/// A byte: that of the standard library.
using byte = std::byte;
#else
/// A value, or nothing: the part of C++17's `std::optional` that this header needs.
template <class T>
class optional {
public:
    /// Nothing.
    constexpr optional() noexcept = default;
    /// A value.
    constexpr optional(T value) noexcept : value_(std::move(value)), has_value_(true) {}

    /// Returns true if there is a value.
    constexpr bool has_value() const noexcept { return has_value_; }
    /// Returns true if there is a value.
    constexpr explicit operator bool() const noexcept { return has_value_; }
    /// The value, which must be there.
    constexpr T &operator*() & noexcept { return assert(has_value_), value_; }
    /// The value, which must be there.
    constexpr const T &operator*() const & noexcept { return assert(has_value_), value_; }
    /// The value, which must be there, to move from.
    constexpr T &&operator*() && noexcept { return assert(has_value_), std::move(value_); }
    /// The value's members; it must be there.
    constexpr T *operator->() noexcept { return assert(has_value_), &value_; }
    /// The value's members; it must be there.
    constexpr const T *operator->() const noexcept { return assert(has_value_), &value_; }

private:
    T value_{};
    bool has_value_ = false;
};
/// A byte.
using byte = unsigned char;
#endif

// --- a value or a status --------------------------------------------------------------------------

/// A value, or the status that says why there is none. Test it before you look at the value:
/// `if (!result) return result.error();`
template <class T>
class HGRID_NODISCARD result {
public:
    /// With a value.
    constexpr result(T value) noexcept : value_(std::move(value)) {}
    /// Without one; the status is not `ok`.
    constexpr result(status error) noexcept : error_(error) { assert(error != status::ok); }

    /// Returns true if there is a value.
    constexpr bool has_value() const noexcept { return value_.has_value(); }
    /// Returns true if there is a value.
    constexpr explicit operator bool() const noexcept { return value_.has_value(); }
    /// The reason why there is no value, or `ok` if there is one.
    constexpr status error() const noexcept { return error_; }

    /// The value, which must be there.
    constexpr T &operator*() & noexcept { return assert(value_), *value_; }
    /// The value, which must be there.
    constexpr const T &operator*() const & noexcept { return assert(value_), *value_; }
    /// The value of a result that is about to go, which must be there. It is moved out, so a reference may be bound to
    /// it: `const auto &grid = *hgrid::grid::build(mesh);`.
    constexpr T operator*() && noexcept { return assert(value_), *std::move(value_); }
    /// The value's members; it must be there.
    constexpr T *operator->() noexcept { return assert(value_), &*value_; }
    /// The value's members; it must be there.
    constexpr const T *operator->() const noexcept { return assert(value_), &*value_; }

private:
    optional<T> value_;
    status error_ = status::ok;
};

// --- elements in a row ----------------------------------------------------------------------------

namespace detail {

// The same as std::void_t.
template <class...>
struct make_void {
    using type = void;
};
template <class... T>
using void_t = typename make_void<T...>::type;

// Tells whether a callable takes these arguments, and what it returns.
template <class Void, class F, class... Arguments>
struct calls : std::false_type {};
template <class F, class... Arguments>
struct calls<void_t<decltype(std::declval<F>()(std::declval<Arguments>()...))>, F, Arguments...>
    : std::true_type {};
template <class F, class... Arguments>
using is_callable = calls<void, F, Arguments...>;
template <class F, class... Arguments>
using answer_of = decltype(std::declval<F>()(std::declval<Arguments>()...));

// The same as std::data and std::size.
template <class C>
constexpr auto data_of(C &container) noexcept -> decltype(container.data())
{
    return container.data();
}
template <class T, std::size_t N>
constexpr T *data_of(T (&array)[N]) noexcept
{
    return array;
}
template <class C>
constexpr auto size_of(const C &container) noexcept -> decltype(container.size())
{
    return container.size();
}
template <class T, std::size_t N>
constexpr std::size_t size_of(const T (&)[N]) noexcept
{
    return N;
}

// Returns true if a build goes on after its progress was told.
template <class F>
bool goes_on(F &progress, float done, std::true_type) noexcept
{
    return progress(done), true;
}
template <class F>
bool goes_on(F &progress, float done, std::false_type) noexcept
{
    return static_cast<bool>(progress(done));
}

// Returns the answer of a filter that takes a hit alone, or also its ray's place.
template <class F, class Hit>
auto verdict_of(F &filter, std::size_t, const Hit &at, std::true_type) noexcept
{
    return filter(at);
}
template <class F, class Hit>
auto verdict_of(F &filter, std::size_t place, const Hit &at, std::false_type) noexcept
{
    return filter(place, at);
}

// Returns the answer as C takes it.
template <class Answer>
::hgrid_verdict number(Answer answer) noexcept
{
    // C's verdict is an integer, and as a bool it would be another one.
    static_assert(std::is_same<Answer, verdict>::value || std::is_same<Answer, bool>::value,
                  "a filter answers with a hgrid::verdict (not C's HGRID_ACCEPT) or a bool: a lambda says so by "
                  "-> hgrid::verdict or -> bool");
    return static_cast<::hgrid_verdict>(answer);
}

template <class C>
using element_of = std::remove_pointer_t<decltype(data_of(std::declval<C &>()))>;

// Tells whether the elements of a container are T, but for const.
template <class C, class T, class = void>
struct holds : std::false_type {};
template <class C, class T>
struct holds<C, T, void_t<element_of<C>, decltype(size_of(std::declval<C &>()))>>
    : std::is_convertible<element_of<C> (*)[], T (*)[]> {};

// Tells whether a type owns its elements. A destructor with work to do tells an owner from a span. Arrays have none,
// and are owners all the same.
template <class C>
struct owns : std::integral_constant<bool, !std::is_trivially_destructible<C>::value> {};
template <class T, std::size_t N>
struct owns<T[N]> : std::true_type {};
template <class T, std::size_t N>
struct owns<std::array<T, N>> : std::true_type {};

// Tells whether what is referred to is there later.
template <class C>
struct stays : std::integral_constant<bool, std::is_lvalue_reference<C>::value ||
                                                !owns<std::remove_cv_t<std::remove_reference_t<C>>>::value> {};

} // namespace detail

/// Elements side by side: a pointer and a number. Made from arrays and from everything with `data()`
/// and `size()`: `std::vector`, `std::array`, C++20's `std::span`.
template <class T>
class span {
public:
    /// No elements.
    constexpr span() noexcept = default;
    /// `size` elements from an address on.
    constexpr span(T *data, std::size_t size) noexcept : data_(data), size_(size) {}
    /// The elements of a container or an array. One that is to be written must not be a temporary.
    template <class C,
              std::enable_if_t<detail::holds<std::remove_reference_t<C>, T>::value &&
                                   (std::is_const<T>::value || detail::stays<C &&>::value),
                               int> = 0>
    constexpr span(C &&container) noexcept
        : data_(detail::data_of(container)), size_(detail::size_of(container))
    {
    }

    /// The first element; may be null if there is none.
    constexpr T *data() const noexcept { return data_; }
    /// The number of elements.
    constexpr std::size_t size() const noexcept { return size_; }
    /// Returns true if there is no element.
    constexpr bool empty() const noexcept { return size_ == 0; }
    /// The first element, for loops.
    constexpr T *begin() const noexcept { return data_; }
    /// Behind the last element, for loops.
    constexpr T *end() const noexcept { return data_ + size_; }
    /// An element; there must be one.
    constexpr T &operator[](std::size_t i) const noexcept { return assert(i < size_), data_[i]; }
    /// `count` elements from the i-th on; they must be there.
    constexpr span subspan(std::size_t i, std::size_t count) const noexcept
    {
        assert(i <= size_ && count <= size_ - i);
        return {data_ + i, count};
    }

private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

/// The bytes of elements.
template <class C>
span<const byte> as_bytes(const C &container) noexcept
{
    return {reinterpret_cast<const byte *>(detail::data_of(container)),
            detail::size_of(container) * sizeof(*detail::data_of(container))};
}

/// The bytes are those of the elements, which must live as long: give the elements a name.
template <class C, std::enable_if_t<!detail::stays<C &&>::value, int> = 0>
span<const byte> as_bytes(C &&) = delete;

/// The bytes of elements, to be written: an array becomes a region. The elements are not const, and have a name.
template <class C,
          std::enable_if_t<detail::stays<C &&>::value &&
                               !std::is_const<detail::element_of<std::remove_reference_t<C>>>::value,
                           int> = 0>
span<byte> as_writable_bytes(C &&container) noexcept
{
    return {reinterpret_cast<byte *>(detail::data_of(container)),
            detail::size_of(container) * sizeof(*detail::data_of(container))};
}

/// Elements at a fixed distance in bytes, as fields of structs are. Made from all that makes a span,
/// and by `field`.
template <class T>
class strided {
public:
    /// No elements.
    constexpr strided() noexcept = default;
    /// `size` elements, each `stride_bytes` bytes behind the one before.
    constexpr strided(T *first, std::size_t stride_bytes, std::size_t size) noexcept
        : first_(first), stride_(stride_bytes), size_(size)
    {
    }
    /// Elements side by side, as for `span`.
    template <class C, std::enable_if_t<std::is_constructible<span<T>, C &&>::value, int> = 0>
    constexpr strided(C &&container) noexcept
        : first_(detail::data_of(container)), stride_(sizeof(T)), size_(detail::size_of(container))
    {
    }
    /// The same elements, not to be written.
    template <class U,
              std::enable_if_t<std::is_same<const U, T>::value && !std::is_const<U>::value, int> = 0>
    constexpr strided(const strided<U> &other) noexcept
        : first_(other.first()), stride_(other.stride()), size_(other.size())
    {
    }

    /// The first element; may be null if there is none.
    constexpr T *first() const noexcept { return first_; }
    /// Bytes from one element to the next.
    constexpr std::size_t stride() const noexcept { return stride_; }
    /// The number of elements.
    constexpr std::size_t size() const noexcept { return size_; }
    /// An element; there must be one.
    T &operator[](std::size_t i) const noexcept
    {
        using raw = std::conditional_t<std::is_const<T>::value, const byte, byte>;
        assert(i < size_);
        return *reinterpret_cast<T *>(reinterpret_cast<raw *>(first_) + i * stride_);
    }

private:
    T *first_ = nullptr;
    std::size_t stride_ = sizeof(T);
    std::size_t size_ = 0;
};

/// One field of each struct: `hgrid::field(pixels, &pixel::ray)`.
template <class C, class S, class M,
          std::enable_if_t<std::is_convertible<detail::element_of<C> *, const S *>::value, int> = 0>
constexpr auto field(C &&structs, M S::*member) noexcept
{
    using struct_type = detail::element_of<C>;
    using field_type = std::conditional_t<std::is_const<struct_type>::value, const M, M>;
    static_assert(detail::stays<C &&>::value, "the structs must outlive this: give them a name");
    const bool empty = detail::size_of(structs) == 0;
    return strided<field_type>(empty ? nullptr : std::addressof(detail::data_of(structs)->*member),
                               sizeof(struct_type), detail::size_of(structs));
}

/// One field of each struct that is a field itself.
template <class T, class S, class M>
constexpr auto field(const strided<T> &structs, M S::*member) noexcept
{
    using field_type = std::conditional_t<std::is_const<T>::value, const M, M>;
    const bool empty = structs.size() == 0;
    return strided<field_type>(empty ? nullptr : std::addressof(structs.first()->*member),
                               structs.stride(), structs.size());
}

// --- the mesh -------------------------------------------------------------------------------------

namespace detail {

template <class T>
struct is_strided : std::false_type {};
template <class T>
struct is_strided<strided<T>> : std::true_type {};

// The type that a vertex or a triangle is made of: T itself if it is a number, the element type of an array
// or of anything with value_type, or else void.
template <class T, class = void>
struct scalar {
    using type = std::conditional_t<std::is_arithmetic<T>::value, T, void>;
};
template <class T, std::size_t N>
struct scalar<T[N], void> {
    using type = T;
};
template <class T>
struct scalar<T, void_t<typename T::value_type>> {
    using type = typename T::value_type;
};

// Converts to one type of numbers and to nothing else.
template <class Number>
struct only {
    template <class T, std::enable_if_t<std::is_same<T, Number>::value, int> = 0>
    constexpr operator T() const noexcept
    {
        return 0;
    }
};

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmissing-braces"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#endif
#if HGRID_CPP >= 201703L
template <class T>
using is_aggregate = std::is_aggregate<T>;
#else
// Converts to everything.
struct anything {
    template <class T>
    constexpr operator T() const noexcept;
};
// Tells whether values in braces go to members and not to a constructor.
template <class T, class = void>
struct is_aggregate : std::false_type {};
template <class T>
struct is_aggregate<T, void_t<decltype(T{anything(), anything()})>>
    : std::integral_constant<bool, !std::is_constructible<T, anything, anything>::value &&
                                       !std::is_constructible<T, std::initializer_list<float>>::value &&
                                       !std::is_constructible<T, std::initializer_list<double>>::value> {};
#endif
// Tells whether an aggregate begins with three numbers of a type, in members of its own or in arrays and structs
// that it begins with.
template <class T, class Number, class = void>
struct begins_with : std::false_type {};
template <class T, class Number>
struct begins_with<T, Number, void_t<decltype(T{only<Number>(), only<Number>(), only<Number>()})>>
    : std::integral_constant<bool, is_aggregate<T>::value && std::is_standard_layout<T>::value> {};
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

// Tells whether a class, which may have constructors, begins with numbers x, y and z of a type.
template <class T, class Number, class = void>
struct has_xyz : std::false_type {};
template <class T, class Number>
struct has_xyz<T, Number, void_t<decltype(T::x), decltype(T::y), decltype(T::z)>>
    : std::integral_constant<bool, std::is_standard_layout<T>::value &&
                                       std::is_same<decltype(T::x), Number>::value &&
                                       std::is_same<decltype(T::y), Number>::value &&
                                       std::is_same<decltype(T::z), Number>::value> {};
template <class T, class Number, bool = has_xyz<T, Number>::value>
struct begins_with_xyz : std::false_type {};
template <class T, class Number>
struct begins_with_xyz<T, Number, true>
    : std::integral_constant<bool, offsetof(T, x) == 0 && offsetof(T, y) == sizeof(Number) &&
                                       offsetof(T, z) == 2 * sizeof(Number)> {};

// Tells whether a class has an array of numbers inside, as far as its `[]` tells: those of a const one are const, and
// those of another one are not. Those of a span are the same in both.
template <class T, class Number, class = void>
struct is_array_like : std::false_type {};
template <class T, class Number>
struct is_array_like<T, Number,
                     void_t<decltype(std::declval<T &>()[std::declval<int>()]),
                            decltype(std::declval<const T &>()[std::declval<int>()])>>
    : std::integral_constant<
          bool, std::is_same<decltype(std::declval<T &>()[std::declval<int>()]), Number &>::value &&
                    !std::is_same<decltype(std::declval<const T &>()[std::declval<int>()]), Number &>::value &&
                    !std::is_polymorphic<T>::value> {};

// Tells whether a class whose members are not known has nothing but three numbers, of which it is made.
template <class T, class Number>
struct is_three : std::integral_constant<bool, sizeof(T) == 3 * sizeof(Number) &&
                                                   std::is_constructible<T, Number, Number, Number>::value> {};

// Tells whether a vertex begins with three numbers of a type.
template <class T, class Number>
struct is_vertex
    : std::integral_constant<bool, begins_with<T, Number>::value || begins_with_xyz<T, Number>::value ||
                                       (!is_aggregate<T>::value && !has_xyz<T, Number>::value &&
                                        (is_array_like<T, Number>::value || is_three<T, Number>::value))> {};

template <class T>
constexpr strided<const T> elements(const strided<T> &container) noexcept
{
    return container;
}
template <class C, std::enable_if_t<!is_strided<C>::value, int> = 0>
constexpr strided<const element_of<const C>> elements(const C &container) noexcept
{
    return container;
}

// Returns the first mask as C takes it, and the stride. A call refuses a stride below the four bytes of a mask, so 1
// marks a wrong number of masks.
inline const void *masks_of(const strided<const std::uint32_t> &masks, std::size_t count,
                            std::size_t &stride) noexcept
{
    static const std::uint32_t none = 0;
    const bool is_one_each = masks.size() == count;
    stride = is_one_each ? masks.stride() : 1;
    return is_one_each ? masks.first() : &none;
}

} // namespace detail

/// A description of vertices and triangles: `hgrid_mesh`. It refers to them; they stay where they are,
/// unchanged, for as long as a grid of this mesh is queried.
class mesh {
public:
    /// A mesh of a container of vertices and one of indices.
    ///
    /// Vertices are structs that begin with three floats (anything may follow), classes that begin with
    /// floats x, y, z or with an array of floats that `[]` gives, arrays of floats, or floats alone, three for
    /// each vertex. All else does not compile; that such an array is the first member, the compiler cannot see.
    /// If the floats are elsewhere in the struct: `field(vertices, &vertex::position)`.
    ///
    /// Indices are numbers of 16 bits (unsigned) or 32, three for each triangle; or arrays of three;
    /// or a field of a struct, from which on there are three: `field(faces, &face::corners)`.
    /// One or two numbers that are left over at the end make no vertex or triangle, and are ignored.
    ///
    /// Arrays of four do not compile, as they may be quads: make two triangles of each. If the fourth number is
    /// padding, say where the first one is, and the bytes from triangle to triangle:
    ///
    ///     const hgrid::strided<const std::uint32_t> corners(padded[0].data(), sizeof padded[0], padded.size());
    ///     const hgrid::mesh mesh(vertices, corners);
    template <class Vertices, class Indices>
    mesh(Vertices &&vertices, Indices &&indices) noexcept
    {
        static_assert(detail::stays<Vertices &&>::value && detail::stays<Indices &&>::value,
                      "the mesh refers to its vertices and indices: give them a name");
        set_positions<detail::is_strided<std::decay_t<Vertices>>::value>(detail::elements(vertices));
        set_indices<detail::is_strided<std::decay_t<Indices>>::value>(detail::elements(indices));
    }
    /// A mesh that was described in C.
    explicit mesh(const ::hgrid_mesh &raw) noexcept : raw_(raw) {}

    /// Joins meshes: describes several as one, for a grid of them all. Nothing is copied; the triangles are
    /// numbered through all meshes, and `view::locate` tells which one a hit is on. There are as many
    /// `parts` as meshes, and they stay where they are, unchanged, as the meshes' arrays do. See `hgrid_join`.
    static result<mesh> join(span<const mesh> meshes, span<part> parts) noexcept
    {
        static_assert(sizeof(mesh) == sizeof(::hgrid_mesh), "an array of the one is one of the other");
        if (parts.size() < meshes.size())
            return status::invalid_parts;
        ::hgrid_mesh all = HGRID_MESH_INIT;
        const ::hgrid_mesh *first = meshes.empty() ? nullptr : &meshes.data()->raw_;
        const status answer = detail::said(::hgrid_join(first, meshes.size(), parts.data(), &all));
        return answer == status::ok ? result<mesh>(mesh(all)) : answer;
    }

    /// Adds a visibility mask for each triangle. If there are not as many masks as triangles, every call
    /// with this mesh answers `invalid_masks` (one without triangles ignores them).
    mesh &masks(strided<const std::uint32_t> masks) noexcept
    {
        raw_.masks = detail::masks_of(masks, raw_.triangle_count, raw_.mask_stride);
        return *this;
    }
    /// The mesh refers to its masks: give them a name.
    template <class Masks, std::enable_if_t<!detail::stays<Masks &&>::value, int> = 0>
    mesh &masks(Masks &&) = delete;

    /// The number of vertices.
    std::size_t vertex_count() const noexcept { return raw_.vertex_count; }
    /// The number of triangles.
    std::size_t triangle_count() const noexcept { return raw_.triangle_count; }
    /// The same for a call in C.
    const ::hgrid_mesh &c() const noexcept { return raw_; }

private:
    template <bool IsField, class V>
    void set_positions(const strided<const V> &vertices) noexcept
    {
        using number = typename detail::scalar<V>::type;
        constexpr bool is_flat = std::is_same<V, float>::value && !IsField;
        constexpr bool has_floats = std::is_same<V, float>::value || detail::is_vertex<V, float>::value;
        // Some classes with floats can be made from doubles, too.
        constexpr bool is_double =
            std::is_same<number, double>::value || (!has_floats && detail::is_vertex<V, double>::value);
        static_assert(!is_double, "coordinates must be float, not double: or name a field of floats");
        static_assert(is_double || std::is_same<number, float>::value || std::is_void<number>::value,
                      "the coordinates of a vertex are floats");
        static_assert(is_double || std::is_same<V, float>::value || sizeof(V) >= 3 * sizeof(float),
                      "a vertex has three coordinates");
        // A std::vector<float> is larger than three floats, too, but does not begin with them.
        static_assert(std::is_void<number>::value || std::is_trivially_destructible<V>::value,
                      "a vertex holds its floats: std::vector keeps them elsewhere, std::array does not; for a class "
                      "with a destructor, name the field: hgrid::field(vertices, &vertex::position)");
        static_assert(is_double || has_floats,
                      "where does the vertex have its three floats? name the field: "
                      "hgrid::field(vertices, &vertex::position)");
        raw_.positions = vertices.first();
        raw_.position_stride = is_flat ? 3 * sizeof(float) : vertices.stride();
        raw_.vertex_count = is_flat ? vertices.size() / 3 : vertices.size();
    }

    template <bool IsField, class I>
    void set_indices(const strided<const I> &indices) noexcept
    {
        using found = typename detail::scalar<I>::type;
        static_assert(!std::is_void<found>::value,
                      "where does the triangle have its indices? name the field: "
                      "hgrid::field(triangles, &triangle::corners)");
        using number = std::conditional_t<std::is_void<found>::value, std::uint32_t, found>;
        constexpr bool is_flat = std::is_same<I, number>::value && !IsField;
        static_assert(std::is_integral<number>::value &&
                          (sizeof(number) == 4 ||
                           (sizeof(number) == 2 && std::is_unsigned<number>::value)),
                      "indices are integers of 32 bits, or unsigned ones of 16");
        static_assert(std::is_same<I, number>::value || sizeof(I) >= 3 * sizeof(number),
                      "a triangle has three indices");
        static_assert(std::is_void<found>::value || std::is_trivially_destructible<I>::value,
                      "a triangle holds its indices: std::vector keeps them elsewhere, std::array does not");
        // Four may be a quad, of which half would be missing.
        static_assert(std::is_same<I, number>::value || sizeof(I) <= 3 * sizeof(number),
                      "a triangle has three indices, not more: make two triangles of a quad; if the fourth is padding, "
                      "pass hgrid::strided<const std::uint32_t>(first_index, stride_in_bytes, triangle_count)");
        raw_.index_type = sizeof(number) == 4 ? HGRID_INDEX_U32 : HGRID_INDEX_U16;
        raw_.indices = indices.first();
        raw_.index_stride = is_flat ? 3 * sizeof(number) : indices.stride();
        raw_.triangle_count = is_flat ? indices.size() / 3 : indices.size();
    }

#if HGRID_CPP < 201703L
    friend class optional<mesh>;
    mesh() noexcept = default;
#endif

    ::hgrid_mesh raw_ = HGRID_MESH_INIT;
};

/// The place of a triangle among joined meshes.
struct location {
    /// The place of the mesh in what was joined.
    std::uint32_t geometry;
    /// The triangle's number in that mesh.
    std::uint32_t triangle;
};

// --- builds ---------------------------------------------------------------------------------------

/// A part of a build: call it with the numbers that `parallel_for` asks for.
class task {
public:
    /// Runs the part of this number.
    void operator()(std::uint32_t index) const noexcept { function_(context_, index); }

private:
    friend class config;
    task(::hgrid_task function, void *context) noexcept : function_(function), context_(context) {}
    ::hgrid_task function_;
    void *context_;
};

/// The configuration of a build: `hgrid_config`. Each method has its usual numbers.
class config {
public:
    /// The usual numbers of a method.
    config(method of = method::bvh) noexcept
    {
        static constexpr ::hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;
        static constexpr ::hgrid_config fixed = HGRID_CONFIG_INIT_FIXED;
        static constexpr ::hgrid_config variable = HGRID_CONFIG_INIT_VARIABLE;
        static constexpr ::hgrid_config recursive = HGRID_CONFIG_INIT_RECURSIVE;
        static constexpr ::hgrid_config bvh = HGRID_CONFIG_INIT_BVH;
        switch (of) {
        case method::one_level: raw_ = one_level; break;
        case method::fixed: raw_ = fixed; break;
        case method::variable: raw_ = variable; break;
        case method::recursive: raw_ = recursive; break;
        case method::bvh: raw_ = bvh; break;
        }
        // C refuses a number that is none of these.
        raw_.method = static_cast<std::uint32_t>(of);
    }

    /// Cells for each triangle. Not for bvh.
    config &density(float cells) noexcept { return raw_.density = cells, *this; }
    /// Cells in a macrocell, along each axis. For fixed.
    config &macrocell_factor(std::uint32_t cells) noexcept
    {
        return raw_.macrocell_factor = cells, *this;
    }
    /// The most triangles in a cell without a subgrid. For variable.
    config &subdivide_above(std::uint32_t triangles) noexcept
    {
        return raw_.subdivide_above = triangles, *this;
    }
    /// Levels of grids. For recursive.
    config &depth(std::uint32_t levels) noexcept { return raw_.depth = levels, *this; }
    /// How much time the build spends on faster rays. For bvh.
    config &quality(hgrid::quality of) noexcept
    {
        return raw_.quality = static_cast<std::uint32_t>(of), *this;
    }
    /// Makes triangles that are not finite an error, or leaves them out.
    config &strict(bool is_strict) noexcept
    {
        return raw_.flags = is_strict ? HGRID_BUILD_STRICT : 0u, *this;
    }

    /// Calls `callable(float done)` during a build, from 0 to exactly 1, on the thread that builds. If
    /// it returns a bool, false cancels.
    template <class F>
    config &progress(F &callable) noexcept
    {
        static_assert(detail::is_callable<F &, float>::value, "progress is called with a float");
        progress_object_ = address(callable);
        progress_ = [](void *object, float done) noexcept -> bool {
            using is_void = std::is_void<detail::answer_of<F &, float>>;
            return detail::goes_on(*static_cast<F *>(object), done, is_void());
        };
        return *this;
    }
    /// The configuration refers to the callable: give it a name.
    template <class F>
    config &progress(const F &&) = delete;

    /// Builds in up to so many tasks at once, each of which takes scratch.
    ///
    /// `callable(std::uint32_t count, hgrid::task each)` calls `each(i)` for every i below `count`, on
    /// any threads, and returns when all these calls have. `hgrid_config` says more at `run`.
    template <class F>
    config &parallel_for(std::uint32_t tasks, F &callable) noexcept
    {
        static_assert(detail::is_callable<F &, std::uint32_t, task>::value,
                      "parallel_for is called with a std::uint32_t and a hgrid::task");
        raw_.tasks = tasks;
        run_object_ = address(callable);
        run_ = [](void *object, std::uint32_t count, task each) noexcept {
            (*static_cast<F *>(object))(count, each);
        };
        return *this;
    }
    /// The configuration refers to the callable: give it a name.
    template <class F>
    config &parallel_for(std::uint32_t, const F &&) = delete;

    /// The same for a call in C, which must end before this configuration does.
    ::hgrid_config c() const noexcept
    {
        ::hgrid_config raw = raw_;
        raw.context = const_cast<config *>(this);
        if (run_ != nullptr)
            raw.run = [](void *context, std::uint32_t count, ::hgrid_task function,
                         void *task_context) noexcept {
                const auto *self = static_cast<const config *>(context);
                self->run_(self->run_object_, count, task(function, task_context));
            };
        if (progress_ != nullptr)
            raw.progress = [](void *context, std::uint32_t done) noexcept -> bool {
                const auto *self = static_cast<const config *>(context);
                return self->progress_(self->progress_object_,
                                       static_cast<float>(done) / HGRID_PROGRESS_END);
            };
        return raw;
    }

private:
    friend class grid;
    friend result<config> fit(const mesh &, const config &, std::size_t, span<byte>,
                              report *) noexcept;

    template <class F>
    static void *address(F &callable) noexcept
    {
        static_assert(!std::is_function<F>::value, "put the function into a lambda");
        return const_cast<void *>(static_cast<const void *>(std::addressof(callable)));
    }

    ::hgrid_config raw_ = HGRID_CONFIG_INIT;
    void *progress_object_ = nullptr;
    bool (*progress_)(void *, float) noexcept = nullptr;
    void *run_object_ = nullptr;
    void (*run_)(void *, std::uint32_t, task) noexcept = nullptr;
};

// --- options of queries ---------------------------------------------------------------------------

/// The options of a query: `hgrid_query_options`. Made once, for any number of queries.
class options {
public:
    /// Triangles are seen whose mask has a bit in common with this one.
    options &mask(std::uint32_t bits) noexcept { return raw_.mask = bits, *this; }
    /// Triangles are not hit from this side.
    options &cull(culling side) noexcept
    {
        return raw_.cull = static_cast<std::uint32_t>(side), *this;
    }
    /// This triangle is not hit: the one where the ray starts.
    options &skip(std::uint32_t primitive) noexcept { return raw_.skip = primitive, *this; }
    /// Adds up the work of queries here. Each thread needs its own.
    options &count(counters &work) noexcept { return raw_.counters = &work, *this; }
    /// Lends memory in which a batch of incoherent rays may be sorted, 16 bytes a ray. Each thread
    /// needs its own.
    options &sort_in(span<byte> scratch) noexcept
    {
        return raw_.scratch = scratch.data(), raw_.scratch_bytes = scratch.size(), *this;
    }

    /// The filter is asked about triangles whose mask has a bit in common with this one; the others are
    /// opaque and count unasked. With 0 or all bits it is asked about every triangle.
    options &filter_mask(std::uint32_t bits) noexcept { return raw_.filter_mask = bits, *this; }

    /// Asks `callable` about each hit, from near to far, each triangle at most once a ray.
    ///
    /// It is called with the hit, or with the ray's place in its batch and the hit, and returns a
    /// `verdict`, or a bool: whether the hit counts.
    ///
    ///     auto is_leaf_there = [&](const hgrid::hit &hit) { return alpha(hit) > 0.5f; };
    ///     hgrid::options options;
    ///     options.filter(is_leaf_there);
    template <class F>
    options &filter(F &callable) noexcept
    {
        static_assert(!std::is_function<F>::value, "put the function into a lambda");
        static_assert(detail::is_callable<F &, const hit &>::value ||
                          detail::is_callable<F &, std::size_t, const hit &>::value,
                      "a filter is called with a hit, or with a place and a hit");
        raw_.context = const_cast<void *>(static_cast<const void *>(std::addressof(callable)));
        raw_.filter = [](void *context, std::size_t place, const hit *at) noexcept {
            using takes_hit = detail::is_callable<F &, const hit &>;
            return detail::number(detail::verdict_of(*static_cast<F *>(context), place, *at, takes_hit()));
        };
        return *this;
    }
    /// The options refer to the filter: give it a name.
    template <class F>
    options &filter(const F &&) = delete;

    /// The same for a call in C.
    const ::hgrid_query_options &c() const noexcept { return raw_; }

private:
    ::hgrid_query_options raw_ = HGRID_QUERY_OPTIONS_INIT;
};

// --- memory ---------------------------------------------------------------------------------------

/// A region that frees itself: bytes from a multiple of `alignment` on.
class memory {
public:
    /// No bytes.
    memory() noexcept = default;
    /// Allocates so many bytes, or returns `out_of_memory`. They may hold anything.
    static result<memory> allocate(std::uint64_t bytes) noexcept
    {
        memory region;
        if (bytes > (std::numeric_limits<std::size_t>::max)() / 2)
            return status::out_of_memory;
        region.bytes_.reset(static_cast<byte *>(aligned(static_cast<std::size_t>(bytes))));
        if (region.bytes_ == nullptr)
            return status::out_of_memory;
        region.size_ = static_cast<std::size_t>(bytes);
        return result<memory>(std::move(region));
    }
    /// Takes the other one's bytes; it has none then.
    memory(memory &&other) noexcept
        : bytes_(std::move(other.bytes_)), size_(std::exchange(other.size_, 0))
    {
    }
    /// Frees its own bytes and takes the other one's.
    memory &operator=(memory &&other) noexcept
    {
        bytes_ = std::move(other.bytes_);
        size_ = std::exchange(other.size_, 0);
        return *this;
    }

    /// The first byte, or null.
    byte *data() const noexcept { return bytes_.get(); }
    /// The number of bytes.
    std::size_t size() const noexcept { return size_; }

private:
    struct freed {
        void operator()(byte *bytes) const noexcept
        {
#if HGRID_CPP >= 201703L
            ::operator delete(bytes, std::align_val_t{alignment}, std::nothrow);
#else
            void *start = nullptr;
            if (bytes != nullptr)
                std::memcpy(&start, bytes - sizeof start, sizeof start);
            ::operator delete(start, std::nothrow);
#endif
        }
    };
#if HGRID_CPP >= 201703L
    static void *aligned(std::size_t bytes) noexcept
    {
        return ::operator new(bytes, std::align_val_t{alignment}, std::nothrow);
    }
#else
    // The address that `operator new` gave is noted in front.
    static void *aligned(std::size_t bytes) noexcept
    {
        void *const start = ::operator new(bytes + alignment + sizeof(void *), std::nothrow);
        if (start == nullptr)
            return nullptr;
        byte *to = static_cast<byte *>(start) + sizeof start;
        to += (alignment - reinterpret_cast<std::uintptr_t>(to) % alignment) % alignment;
        std::memcpy(to - sizeof start, &start, sizeof start);
        return to;
    }
#endif
    std::unique_ptr<byte, freed> bytes_;
    std::size_t size_ = 0;
};

// --- a grid in memory of the caller ---------------------------------------------------------------

/// A grid that owns its memory: see below.
class grid;

/// A grid and its mesh, ready for queries: `hgrid_grid`, in memory that stays the caller's. A view of
/// nothing, as the default one is, hits nothing.
class view {
public:
    /// A view of nothing.
    view() noexcept = default;
    /// A view of a grid that is about to go: give the grid a name.
    view(const grid &&) = delete;
    /// The same. A template, so that `{}` means a view of nothing.
    template <class Grid, std::enable_if_t<!std::is_lvalue_reference<Grid>::value &&
                                               std::is_convertible<Grid *, const grid *>::value,
                                           int> = 0>
    view &operator=(Grid &&) = delete;
    /// A view that was built or opened in C.
    explicit view(const ::hgrid_grid &raw) noexcept : raw_(raw) {}

    /// Builds in an index, which keeps the grid, and a scratch, which is free again afterwards.
    static result<view> build(const mesh &of, const config &how, span<byte> index,
                              span<byte> scratch, report *details = nullptr) noexcept
    {
        view built;
        const ::hgrid_config raw = how.c();
        const status answer = detail::said(::hgrid_build(&of.c(), &raw, index.data(), index.size(),
                                                         scratch.data(), scratch.size(),
                                                         &built.raw_, details));
        return answer == status::ok ? result<view>(built) : answer;
    }
    /// Opens a blob that was built for this mesh, where it lies.
    static result<view> open(span<const byte> blob, const mesh &of) noexcept
    {
        return open(blob, &of.c());
    }
    /// Opens a blob that brings its mesh, as `pack` makes them.
    static result<view> open(span<const byte> blob) noexcept { return open(blob, nullptr); }
    /// A temporary would be freed at once: give the memory a name, or `grid::adopt` it.
    template <class Blob, std::enable_if_t<!detail::stays<Blob &&>::value, int> = 0>
    static result<view> open(Blob &&, const mesh &) = delete;
    /// The same.
    template <class Blob, std::enable_if_t<!detail::stays<Blob &&>::value, int> = 0>
    static result<view> open(Blob &&) = delete;
    /// Gives the tree in a blob the boxes of a mesh whose vertices moved, in place; other views of the blob are of no
    /// use any more. If an object was made of a view variable, assign the new view to the same variable. After an error
    /// the blob is as it was. Errors are those of `hgrid_refit`.
    static result<view> refit(const mesh &of, span<byte> blob, refit_report *details = nullptr) noexcept
    {
        view moved;
        const status answer =
            detail::said(::hgrid_refit(&of.c(), blob.data(), blob.size(), &moved.raw_, details));
        return answer == status::ok ? result<view>(moved) : answer;
    }
    /// Bytes of scratch that `validate` takes: some for a tree, none for the other methods.
    std::size_t validate_bytes() const noexcept { return ::hgrid_validate_bytes(&raw_); }
    /// Proves that a blob from elsewhere is the grid of its mesh, in scratch that may lie at any address.
    status validate(span<byte> scratch) const noexcept
    {
        return detail::said(::hgrid_validate(&raw_, scratch.data(), scratch.size()));
    }
    /// The same in memory of its own, if it takes any.
    status validate() const noexcept
    {
        const std::size_t bytes = validate_bytes();
        if (bytes == 0)
            return validate(span<byte>());
        const auto scratch = memory::allocate(bytes);
        return scratch ? validate(*scratch) : scratch.error();
    }

    /// The closest triangle that a ray hits.
    optional<hit> intersect(const ray &along) const noexcept
    {
        return intersect_in_c(along, nullptr);
    }
    /// The closest triangle that a ray hits and that the options let count.
    optional<hit> intersect(const ray &along, const options &with) const noexcept
    {
        return intersect_in_c(along, &with.c());
    }

    /// Returns true if a ray hits anything.
    bool occluded(const ray &along) const noexcept
    {
        return ::hgrid_occluded(&raw_, &along, nullptr);
    }
    /// Returns true if a ray hits anything that the options let count.
    bool occluded(const ray &along, const options &with) const noexcept
    {
        return ::hgrid_occluded(&raw_, &along, &with.c());
    }

    /// A triangle that blocks a ray, or `invalid_id`: one that the options let count. It need not be the
    /// closest.
    std::uint32_t occluder(const ray &along) const noexcept
    {
        return ::hgrid_occluder(&raw_, &along, nullptr);
    }
    /// The same with options.
    std::uint32_t occluder(const ray &along, const options &with) const noexcept
    {
        return ::hgrid_occluder(&raw_, &along, &with.c());
    }

    /// The closest hit of each ray; a miss has the primitive `invalid_id`. There are as many hits as
    /// rays, or the answer is `invalid_answers`.
    status intersect_n(strided<const ray> rays, strided<hit> hits, coherence know) const noexcept
    {
        return intersect_n_in_c(rays, hits, know, nullptr);
    }
    /// The same with options for all rays.
    status intersect_n(strided<const ray> rays, strided<hit> hits, coherence know,
                       const options &with) const noexcept
    {
        return intersect_n_in_c(rays, hits, know, &with.c());
    }

    /// For each ray 1 if it hits anything, or else 0. There are as many answers as rays, or the answer
    /// is `invalid_answers`.
    status occluded_n(strided<const ray> rays, strided<std::uint8_t> answers,
                      coherence know) const noexcept
    {
        return occluded_n_in_c(rays, answers, know, nullptr);
    }
    /// The same with options for all rays.
    status occluded_n(strided<const ray> rays, strided<std::uint8_t> answers, coherence know,
                      const options &with) const noexcept
    {
        return occluded_n_in_c(rays, answers, know, &with.c());
    }

    /// For each ray a triangle that blocks it, or `invalid_id`. There are as many answers as rays, or the
    /// answer is `invalid_answers`.
    status occluder_n(strided<const ray> rays, strided<std::uint32_t> answers,
                      coherence know) const noexcept
    {
        return occluder_n_in_c(rays, answers, know, nullptr);
    }
    /// The same with options for all rays.
    status occluder_n(strided<const ray> rays, strided<std::uint32_t> answers, coherence know,
                      const options &with) const noexcept
    {
        return occluder_n_in_c(rays, answers, know, &with.c());
    }

    /// Every triangle that a ray hits, sorted by t, as many as there is room for; gives their number,
    /// which may be larger.
    result<std::size_t> intersect_all(const ray &along, span<hit> hits) const noexcept
    {
        return intersect_all_in_c(along, hits, nullptr);
    }
    /// The same with options.
    result<std::size_t> intersect_all(const ray &along, span<hit> hits,
                                      const options &with) const noexcept
    {
        return intersect_all_in_c(along, hits, &with.c());
    }

    /// The nearest point of the mesh that is no farther away than this.
    optional<closest>
    closest_point(const point &from,
                  float max_distance = std::numeric_limits<float>::infinity()) const noexcept
    {
        return closest_point_in_c(from, max_distance, nullptr);
    }
    /// The same with options; culling and filters do not matter.
    optional<closest> closest_point(const point &from, float max_distance,
                                         const options &with) const noexcept
    {
        return closest_point_in_c(from, max_distance, &with.c());
    }

    /// The point where a ray met the mesh, its normal there, and origins for rays that leave it; `at` is
    /// what a query has found for the ray.
    optional<surface> surface_at(const ray &along, const hit &at) const noexcept
    {
        surface found;
        return ::hgrid_surface_at(&raw_, &along, &at, &found) ? optional<surface>(found)
                                                              : optional<surface>();
    }
    /// The box of the grid and a little more: the least x, y and z, then the greatest; zeros for a view of nothing.
    std::array<float, 6> box() const noexcept
    {
        std::array<float, 6> corners = {};
        static_cast<void>(::hgrid_box_of(&raw_, corners.data()));
        return corners;
    }
    /// The mesh that a triangle is of, and its number there, in a grid of joined meshes; nothing if there is no
    /// such triangle.
    optional<location> locate(std::uint32_t primitive) const noexcept
    {
        location found{};
        return ::hgrid_locate(&raw_, primitive, &found.geometry, &found.triangle)
                   ? optional<location>(found)
                   : optional<location>();
    }
    /// The mesh, wherever it lies: the caller's, or the one in a packed blob.
    result<mesh> mesh_of() const noexcept
    {
        ::hgrid_mesh found = HGRID_MESH_INIT;
        const status answer = detail::said(::hgrid_mesh_of(&raw_, &found));
        return answer == status::ok ? result<mesh>(mesh(found)) : answer;
    }

    /// Bytes that `pack` writes; 0 for a view of nothing.
    std::uint64_t packed_bytes() const noexcept
    {
        std::uint64_t bytes = 0;
        static_cast<void>(::hgrid_pack(&raw_, nullptr, 0, &bytes));
        return bytes;
    }
    /// Writes grid and mesh as one blob, which `open` needs no mesh for.
    status pack(span<byte> to) const noexcept
    {
        std::uint64_t bytes = 0;
        return detail::said(::hgrid_pack(&raw_, to.data(), to.size(), &bytes));
    }
    /// The same in memory of its own.
    result<memory> pack() const noexcept
    {
        auto packed = memory::allocate(packed_bytes());
        if (!packed)
            return packed;
        const status answer = pack(*packed);
        return answer == status::ok ? std::move(packed) : answer;
    }

    /// The statistics of the whole grid; looks at all of it.
    result<statistics> inspect() const noexcept
    {
        statistics found = HGRID_STATISTICS_INIT;
        const status answer = detail::said(::hgrid_inspect(&raw_, &found));
        return answer == status::ok ? result<statistics>(found) : answer;
    }

    /// The same for a call in C.
    const ::hgrid_grid &c() const noexcept { return raw_; }

private:
    static result<view> open(span<const byte> blob, const ::hgrid_mesh *of) noexcept
    {
        view opened;
        const status answer = detail::said(::hgrid_open(blob.data(), blob.size(), of,
                                                        &opened.raw_));
        return answer == status::ok ? result<view>(opened) : answer;
    }
    optional<hit> intersect_in_c(const ray &along, const ::hgrid_query_options *with) const noexcept
    {
        hit at;
        return ::hgrid_intersect(&raw_, &along, with, &at) ? optional<hit>(at) : optional<hit>();
    }
    status intersect_n_in_c(strided<const ray> rays, strided<hit> hits, coherence know,
                            const ::hgrid_query_options *with) const noexcept
    {
        if (rays.size() != hits.size())
            return status::invalid_answers;
        return detail::said(::hgrid_intersect_n(&raw_, rays.first(), rays.stride(), hits.first(),
                                                hits.stride(), rays.size(),
                                                static_cast<::hgrid_coherence>(know), with));
    }
    status occluded_n_in_c(strided<const ray> rays, strided<std::uint8_t> answers, coherence know,
                           const ::hgrid_query_options *with) const noexcept
    {
        if (rays.size() != answers.size())
            return status::invalid_answers;
        return detail::said(::hgrid_occluded_n(&raw_, rays.first(), rays.stride(), answers.first(),
                                               answers.stride(), rays.size(),
                                               static_cast<::hgrid_coherence>(know), with));
    }
    status occluder_n_in_c(strided<const ray> rays, strided<std::uint32_t> answers, coherence know,
                           const ::hgrid_query_options *with) const noexcept
    {
        if (rays.size() != answers.size())
            return status::invalid_answers;
        return detail::said(::hgrid_occluder_n(&raw_, rays.first(), rays.stride(), answers.first(),
                                               answers.stride(), rays.size(),
                                               static_cast<::hgrid_coherence>(know), with));
    }
    result<std::size_t> intersect_all_in_c(const ray &along, span<hit> hits,
                                           const ::hgrid_query_options *with) const noexcept
    {
        std::size_t count = 0;
        const status answer = detail::said(
            ::hgrid_intersect_all(&raw_, &along, with, hits.data(), hits.size(), &count));
        return answer == status::ok ? result<std::size_t>(count) : answer;
    }
    optional<closest> closest_point_in_c(const point &from, float max_distance,
                                              const ::hgrid_query_options *with) const noexcept
    {
        const ::hgrid_point_query query = {{from[0], from[1], from[2]}, max_distance};
        closest at;
        return ::hgrid_closest_point(&raw_, &query, with, &at)
                   ? optional<closest>(at)
                   : optional<closest>();
    }

    ::hgrid_grid raw_ = HGRID_GRID_INIT;
};

// --- a grid that owns its memory ------------------------------------------------------------------

/// A built grid and its memory. The mesh stays the caller's, unless `keep` takes it over.
///
/// It is a view, so it answers queries, and where a view is wanted it can be given; that view is good
/// for as long as the grid is. Moving the grid does not move the memory. After a move, make
/// objects of it anew for the scenes that show it.
class grid : public view {
public:
    /// No grid; hits nothing.
    grid() noexcept = default;

    /// Builds, in memory that `operator new` gives.
    ///
    /// The grid keeps a copy of just the bytes it takes, or, without memory for one, the whole region
    /// it was built in; the scratch is freed. Errors are those of
    /// `hgrid_build`, and `out_of_memory`. `details` says which triangle is to blame.
    static result<grid> build(const mesh &of, const config &how = {},
                              report *details = nullptr) noexcept;

    /// Builds a grid that keeps its vertices and indices: both are moved in.
    ///
    ///     auto grid = hgrid::grid::keep(std::move(vertices), std::move(indices));
    ///
    /// Containers are those that a `mesh` is made of, but for spans and fields, which own nothing: the form below
    /// takes them. Moving the grid does not move what it keeps.
    template <class Vertices, class Indices,
              std::enable_if_t<!detail::is_callable<const Indices &, const Vertices &>::value,
                               int> = 0>
    static result<grid> keep(Vertices &&vertices, Indices &&indices, const config &how = {},
                             report *details = nullptr) noexcept
    {
        static_assert(!std::is_lvalue_reference<Vertices>::value &&
                          !std::is_lvalue_reference<Indices>::value,
                      "the grid keeps its vertices and indices: std::move them");
        static_assert(detail::owns<std::remove_cv_t<std::remove_reference_t<Vertices>>>::value &&
                          detail::owns<std::remove_cv_t<std::remove_reference_t<Indices>>>::value,
                      "spans and fields own nothing that the grid could keep: move the data in that they are of, with "
                      "a callable that makes the mesh: hgrid::grid::keep(std::move(data), "
                      "[](const type_of_data &kept) { return hgrid::mesh(...); })");
        struct arrays {
            Vertices vertices;
            Indices indices;
        };
        const auto describe = [](const arrays &kept) noexcept {
            return mesh(kept.vertices, kept.indices);
        };
        return keep(arrays{std::move(vertices), std::move(indices)}, describe, how, details);
    }
    /// The same with data of any kind, which is moved in, and a callable that says what the mesh of them is.
    ///
    ///     auto grid = hgrid::grid::keep(std::move(model), [](const model &kept) {
    ///         return hgrid::mesh(kept.vertices, hgrid::field(kept.faces, &face::corners));
    ///     });
    ///
    /// Data that others use, too, is shared: let the data be a `std::shared_ptr` of it.
    template <class Data, class Describe,
              std::enable_if_t<detail::is_callable<const Describe &, const Data &>::value, int> = 0>
    static result<grid> keep(Data &&data, const Describe &describe, const config &how = {},
                             report *details = nullptr) noexcept
    {
        static_assert(!std::is_lvalue_reference<Data>::value,
                      "the grid keeps its data: std::move them");
        std::unique_ptr<Data> moved(new (std::nothrow) Data(std::move(data)));
        if (moved == nullptr)
            return status::out_of_memory;
        const mesh of = describe(static_cast<const Data &>(*moved));
        auto built = build(of, how, details);
        if (built)
            built->kept_ = {moved.release(), [](void *kept) noexcept {
                                delete static_cast<Data *>(kept);
                            }};
        return built;
    }

    /// Opening takes a view: `view::open` where the blob stays yours, `adopt` where it becomes the grid's.
    template <class... Arguments>
    static void open(Arguments &&...) = delete;

    /// Opens a blob that was built for this mesh, and takes over its memory; if that fails it is freed.
    static result<grid> adopt(memory blob, const mesh &of) noexcept
    {
        const auto opened = view::open(blob, of);
        return opened ? result<grid>(grid(*opened, std::move(blob))) : opened.error();
    }
    /// Opens a blob that brings its mesh, and takes over its memory; if that fails it is freed.
    static result<grid> adopt(memory blob) noexcept
    {
        const auto opened = view::open(blob);
        return opened ? result<grid>(grid(*opened, std::move(blob))) : opened.error();
    }

    /// Takes the other grid, which is empty afterwards.
    grid(grid &&other) noexcept
        : view(std::exchange(static_cast<view &>(other), view())), blob_(std::move(other.blob_)),
          kept_(std::move(other.kept_))
    {
    }
    /// Frees its own memory and takes the other grid, which is empty afterwards.
    grid &operator=(grid &&other) noexcept
    {
        static_cast<view &>(*this) = std::exchange(static_cast<view &>(other), view());
        blob_ = std::move(other.blob_);
        kept_ = std::move(other.kept_);
        return *this;
    }

    /// Gives a tree the boxes of a mesh whose vertices moved, in place; other views of it are of no use any
    /// more. After an error the grid is as it was. Errors are those of `hgrid_refit`.
    ///
    /// `details` becomes the report that is returned, and after an error it says which triangle is to blame.
    result<refit_report> refit(const mesh &of, refit_report *details = nullptr) noexcept
    {
        refit_report own;
        refit_report &found = details != nullptr ? *details : own;
        const auto moved = view::refit(of, blob_, &found);
        if (!moved)
            return moved.error();
        static_cast<view &>(*this) = *moved;
        return found;
    }

    /// The blob: bytes without pointers, to be stored or sent, and opened elsewhere.
    span<const byte> blob() const noexcept { return blob_; }

private:
    grid(const view &built, memory blob) noexcept : view(built), blob_(std::move(blob)) {}

    // Bytes of index that most meshes take. What is certainly enough may be ten or a hundred times as
    // much where the index finds its size while it is written.
    static std::uint64_t usual_bytes(const mesh &of, const config &how) noexcept
    {
        const auto triangles = static_cast<std::uint64_t>(of.triangle_count());
        switch (static_cast<method>(how.raw_.method)) {
        case method::variable: return 96 * triangles + 4096;
        case method::recursive: return 160 * triangles + 4096;
        default: return (std::numeric_limits<std::uint64_t>::max)();
        }
    }

    memory blob_;
    // The data that the mesh refers to, if the grid keeps it.
    std::unique_ptr<void, void (*)(void *)> kept_{nullptr, [](void *) {}};
};

/// Tells how much memory a build of this mesh takes: roughly, or with scratch exactly.
inline status sizes(const mesh &of, const config &how, report &found,
                    span<byte> scratch = {}) noexcept
{
    const ::hgrid_config raw = how.c();
    return detail::said(::hgrid_sizes(&of.c(), &raw, scratch.data(), scratch.size(), &found));
}

/// Tells how much memory is enough for any mesh with so many triangles.
inline result<report> bound(std::size_t triangle_count, const config &how) noexcept
{
    const ::hgrid_config raw = how.c();
    report found;
    const status answer = detail::said(::hgrid_bound(triangle_count, &raw, &found));
    return answer == status::ok ? result<report>(found) : answer;
}

/// Finds the finest grid of a method that fits into so many bytes.
inline result<config> fit(const mesh &of, const config &how, std::size_t index_bytes,
                          span<byte> scratch, report *details = nullptr) noexcept
{
    const ::hgrid_config raw = how.c();
    config fitted = how;
    report found;
    const status answer = detail::said(::hgrid_fit(&of.c(), &raw, index_bytes, scratch.data(),
                                                   scratch.size(), &fitted.raw_,
                                                   details != nullptr ? details : &found));
    // The callables are set for each call.
    fitted.raw_.context = nullptr, fitted.raw_.run = nullptr, fitted.raw_.progress = nullptr;
    return answer == status::ok ? result<config>(fitted) : answer;
}

/// Reads what the first bytes of a blob say, to learn how large it is before all of it is there.
inline result<blob_info> peek(span<const byte> blob) noexcept
{
    blob_info found = HGRID_BLOB_INFO_INIT;
    const status answer = detail::said(::hgrid_peek(blob.data(), blob.size(), &found));
    return answer == status::ok ? result<blob_info>(found) : answer;
}

inline result<grid> grid::build(const mesh &of, const config &how, report *details) noexcept
{
    report own;
    report &found = details != nullptr ? *details : own;

    // There may be two attempts, which progress reports as one.
    float shown = -1;
    auto forward = [&](float done) {
        return done <= shown || (shown = done, how.progress_(how.progress_object_, done));
    };
    config attempt = how;
    if (how.progress_ != nullptr)
        attempt.progress(forward);

    const status known = sizes(of, how, found);
    if (known != status::ok)
        return known;
    auto scratch = memory::allocate(found.scratch_bytes);
    if (!scratch)
        return scratch.error();
    const std::uint64_t usual = usual_bytes(of, how);
    std::uint64_t bytes = found.index_bytes < usual ? found.index_bytes : usual;
    for (;;) {
        auto index = memory::allocate(bytes);
        if (!index)
            return index.error();
        const auto built = view::build(of, attempt, *index, *scratch, &found);
        if (!built && (built.error() != status::index_too_small || found.index_bytes <= bytes))
            return built.error();
        if (!built) {
            bytes = found.index_bytes;
            continue;
        }
        // Keep what it takes. If there is no memory for that, keep all.
        auto kept = memory::allocate(found.index_bytes);
        if (found.index_bytes == bytes || !kept)
            return grid(*built, std::move(*index));
        std::memcpy(kept->data(), index->data(), kept->size());
        return adopt(std::move(*kept), of);
    }
}

// --- shapes and scenes ---------------------------------------------------------------------------

/// The hit of a ray on a shape. See `hgrid_shape_hit`.
using shape_hit = ::hgrid_shape_hit;
/// The hit of a ray in a scene. See `hgrid_scene_hit`.
using scene_hit = ::hgrid_scene_hit;
/// An object at a place in a scene. See `hgrid_instance`. An array that was filled in C goes to `hgrid_build_scene`.
struct instance : ::hgrid_instance {
    /// The first object where it is, with the identity transform.
    instance() noexcept : ::hgrid_instance HGRID_INSTANCE_INIT {}
    /// The object of this number among those of the scene.
    explicit instance(std::uint32_t number) noexcept : instance() { object = number; }
    /// One that was filled in C.
    instance(const ::hgrid_instance &raw) noexcept : ::hgrid_instance(raw) {}
};
/// An object that instances show. See `hgrid_object`; `make_object` makes it. `object none{};` shows nothing: rays miss
/// its instances.
using object = ::hgrid_object;

/// The options of a query of a scene: `hgrid_scene_options`. They refer to the filter, the counters and the memory
/// that they were given.
class scene_options {
public:
    /// Instances are seen whose mask has a bit in common with this one, and so are triangles and shapes in them.
    scene_options &mask(std::uint32_t bits) noexcept { return raw_.mask = bits, *this; }
    /// Triangles are not hit from this side.
    scene_options &cull(culling side) noexcept { return raw_.cull = static_cast<std::uint32_t>(side), *this; }
    /// Adds up the work of queries here. Each thread needs its own.
    scene_options &count(counters &work) noexcept { return raw_.counters = &work, *this; }
    /// Lends memory in which a batch of incoherent rays may be sorted, 16 bytes a ray. Each thread needs its own.
    scene_options &sort_in(span<byte> scratch) noexcept
    {
        return raw_.scratch = scratch.data(), raw_.scratch_bytes = scratch.size(), *this;
    }
    /// Asks `callable` about hits of triangles, for each instance from near to far. It is called with the hit, or with
    /// the ray's place in its batch and the hit, and returns a `verdict`, or a bool: whether the hit counts. In a batch
    /// one ray comes after the other.
    template <class F>
    scene_options &filter(F &callable) noexcept
    {
        static_assert(!std::is_function<F>::value, "put the function into a lambda");
        static_assert(detail::is_callable<F &, const scene_hit &>::value ||
                          detail::is_callable<F &, std::size_t, const scene_hit &>::value,
                      "a filter is called with a hit, or with a place and a hit");
        raw_.context = const_cast<void *>(static_cast<const void *>(std::addressof(callable)));
        raw_.filter = [](void *context, std::size_t place, const scene_hit *at) noexcept {
            using takes_hit = detail::is_callable<F &, const scene_hit &>;
            return detail::number(detail::verdict_of(*static_cast<F *>(context), place, *at, takes_hit()));
        };
        return *this;
    }
    /// The options refer to the filter: give it a name.
    template <class F>
    scene_options &filter(const F &&) = delete;
    /// The filter is asked about triangles whose mask in their mesh has a bit in common with this one; the others are
    /// opaque and count unasked. With 0 or all bits it is asked about every triangle.
    scene_options &filter_mask(std::uint32_t bits) noexcept { return raw_.filter_mask = bits, *this; }
    /// The struct that C takes.
    const ::hgrid_scene_options &c() const noexcept { return raw_; }

private:
    ::hgrid_scene_options raw_ = HGRID_SCENE_OPTIONS_INIT;
};

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#endif
/// Bytes of index that are enough for any scene of so many instances. With the default configuration `scratch_bound` is
/// enough scratch, with `quality::high` `bvh_high_scratch_bound`.
inline constexpr std::size_t scene_bound(std::size_t instances) noexcept
{
    return HGRID_SCENE_BOUND(instances);
}
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/// The boxes of shapes of one's own, six floats each, and the test for them: `hgrid_boxes`. It refers to both.
class boxes {
public:
    /// Boxes with a test: `bool test(std::uint32_t shape, const hgrid::ray &along, hgrid::shape_hit &hit)`, a callable
    /// with a name, which stays where it is for as long as shapes are queried.
    template <class Test>
    boxes(strided<const std::array<float, 6>> all, Test &test) noexcept
    {
        static_assert(!std::is_function<Test>::value, "put the function into a lambda");
        static_assert(detail::is_callable<Test &, std::uint32_t, const ray &, shape_hit &>::value,
                      "a test is called with a shape's number, a ray, and a hit to fill");
        raw_.boxes = all.first();
        raw_.box_stride = all.stride();
        raw_.count = all.size();
        raw_.context = const_cast<void *>(static_cast<const void *>(std::addressof(test)));
        raw_.test = [](void *context, std::uint32_t shape, const ::hgrid_ray *along,
                       ::hgrid_shape_hit *found) noexcept -> bool {
            static_assert(std::is_same<std::decay_t<detail::answer_of<Test &, std::uint32_t, const ray &, shape_hit &>>,
                                       bool>::value,
                          "a test answers with a bool: a lambda says so by -> bool");
            return (*static_cast<Test *>(context))(shape, *along, *found);
        };
    }
    /// Boxes of another kind: they are six floats each.
    template <class Boxes, class Test,
              std::enable_if_t<!std::is_convertible<Boxes &&, strided<const std::array<float, 6>>>::value &&
                                   detail::stays<Boxes &&>::value && std::is_lvalue_reference<Test>::value,
                               int> = 0>
    boxes(Boxes &&, Test &&) noexcept
    {
        static_assert(!std::is_lvalue_reference<Test>::value,
                      "a box is a std::array<float, 6>, two opposite corners; name the field of a struct that has one: "
                      "hgrid::field(shapes, &shape::box)");
    }
    /// Shapes refer to their boxes and to the test: give both a name.
    template <class Boxes = strided<const std::array<float, 6>>, class Test,
              std::enable_if_t<!detail::stays<Boxes &&>::value || !std::is_lvalue_reference<Test>::value, int> = 0>
    boxes(Boxes &&, Test &&) = delete;
    /// A mask for each shape. If there are not as many masks as shapes, every call with these boxes answers
    /// `invalid_masks` (one without shapes ignores them).
    boxes &masks(strided<const std::uint32_t> all) noexcept
    {
        raw_.masks = detail::masks_of(all, raw_.count, raw_.mask_stride);
        return *this;
    }
    /// Shapes refer to their masks: give them a name.
    template <class Masks, std::enable_if_t<!detail::stays<Masks &&>::value, int> = 0>
    boxes &masks(Masks &&) = delete;
    /// The struct that C takes.
    const ::hgrid_boxes &c() const noexcept { return raw_; }

private:
    ::hgrid_boxes raw_ = HGRID_BOXES_INIT;
};

/// A tree over the boxes of shapes: `hgrid_shapes`, in memory that stays the caller's.
class shapes {
public:
    /// A view of nothing, which hits nothing.
    shapes() noexcept = default;
    /// Builds in an index, which keeps the tree, and a scratch.
    static result<shapes> build(const boxes &of, const config &how, span<byte> index, span<byte> scratch,
                                report *details = nullptr) noexcept
    {
        shapes built;
        const ::hgrid_config raw = how.c();
        const status answer = detail::said(::hgrid_build_shapes(&of.c(), &raw, index.data(), index.size(),
                                                                scratch.data(), scratch.size(), &built.raw_,
                                                                details));
        return answer == status::ok ? result<shapes>(built) : answer;
    }
    /// Opens a blob that was built over these boxes.
    static result<shapes> open(span<const byte> blob, const boxes &of) noexcept
    {
        shapes opened;
        const status answer =
            detail::said(::hgrid_open_shapes(blob.data(), blob.size(), &of.c(), &opened.raw_));
        return answer == status::ok ? result<shapes>(opened) : answer;
    }
    /// A temporary would be freed at once: give the memory a name.
    template <class Blob, std::enable_if_t<!detail::stays<Blob &&>::value, int> = 0>
    static result<shapes> open(Blob &&, const boxes &) = delete;
    /// Gives the tree in a blob the boxes of shapes that moved, in place, as `view::refit` does.
    static result<shapes> refit(const boxes &of, span<byte> blob, refit_report *details = nullptr) noexcept
    {
        shapes moved;
        const status answer = detail::said(
            ::hgrid_refit_shapes(&of.c(), blob.data(), blob.size(), &moved.raw_, details));
        return answer == status::ok ? result<shapes>(moved) : answer;
    }
    /// Proves that the blob is a tree of its boxes, in scratch of `validate_bound` bytes.
    status validate(span<byte> scratch) const noexcept
    {
        return detail::said(::hgrid_validate_shapes(&raw_, scratch.data(), scratch.size()));
    }
    /// The closest shape that a ray hits.
    optional<hit> intersect(const ray &along) const noexcept { return intersect_in_c(along, nullptr); }
    /// The same with options, of which `mask`, `skip` and `counters` are used.
    optional<hit> intersect(const ray &along, const options &with) const noexcept
    {
        return intersect_in_c(along, &with.c());
    }
    /// Returns true if a ray hits any shape.
    bool occluded(const ray &along) const noexcept
    {
        return ::hgrid_occluded_shapes(&raw_, &along, nullptr);
    }
    /// The same with options, of which `mask`, `skip` and `counters` are used.
    bool occluded(const ray &along, const options &with) const noexcept
    {
        return ::hgrid_occluded_shapes(&raw_, &along, &with.c());
    }
    /// The closest shape that each ray hits; a miss has the primitive `invalid_id`. There are as many hits as rays, or
    /// the answer is `invalid_answers`.
    status intersect_n(strided<const ray> rays, strided<hit> hits, coherence know) const noexcept
    {
        return intersect_n_in_c(rays, hits, know, nullptr);
    }
    /// The same with options for all rays.
    status intersect_n(strided<const ray> rays, strided<hit> hits, coherence know,
                       const options &with) const noexcept
    {
        return intersect_n_in_c(rays, hits, know, &with.c());
    }
    /// For each ray 1 if it hits any shape, or else 0. There are as many answers as rays, or the answer is
    /// `invalid_answers`.
    status occluded_n(strided<const ray> rays, strided<std::uint8_t> answers, coherence know) const noexcept
    {
        return occluded_n_in_c(rays, answers, know, nullptr);
    }
    /// The same with options for all rays.
    status occluded_n(strided<const ray> rays, strided<std::uint8_t> answers, coherence know,
                      const options &with) const noexcept
    {
        return occluded_n_in_c(rays, answers, know, &with.c());
    }
    /// The box of all shapes and a little more: the least x, y and z, then the greatest.
    std::array<float, 6> box() const noexcept
    {
        std::array<float, 6> corners = {};
        static_cast<void>(::hgrid_box_of_shapes(&raw_, corners.data()));
        return corners;
    }
    /// The struct that C takes.
    const ::hgrid_shapes &c() const noexcept { return raw_; }

private:
    optional<hit> intersect_in_c(const ray &along, const ::hgrid_query_options *with) const noexcept
    {
        hit found;
        return ::hgrid_intersect_shapes(&raw_, &along, with, &found) ? optional<hit>(found) : optional<hit>();
    }
    status intersect_n_in_c(strided<const ray> rays, strided<hit> hits, coherence know,
                            const ::hgrid_query_options *with) const noexcept
    {
        if (rays.size() != hits.size())
            return status::invalid_answers;
        return detail::said(::hgrid_intersect_shapes_n(&raw_, rays.first(), rays.stride(), hits.first(),
                                                       hits.stride(), rays.size(),
                                                       static_cast<::hgrid_coherence>(know), with));
    }
    status occluded_n_in_c(strided<const ray> rays, strided<std::uint8_t> answers, coherence know,
                           const ::hgrid_query_options *with) const noexcept
    {
        if (rays.size() != answers.size())
            return status::invalid_answers;
        return detail::said(::hgrid_occluded_shapes_n(&raw_, rays.first(), rays.stride(), answers.first(),
                                                      answers.stride(), rays.size(),
                                                      static_cast<::hgrid_coherence>(know), with));
    }

    ::hgrid_shapes raw_ = HGRID_SHAPES_INIT;
};

/// A tree over instances of objects: `hgrid_scene`, in memory that stays the caller's. The objects stay where they are,
/// with the views that they name.
class scene {
public:
    /// A view of nothing, which hits nothing.
    scene() noexcept = default;
    /// Builds in an index, which keeps the scene, and a scratch.
    static result<scene> build(span<const instance> all, span<const object> of, const config &how, span<byte> index,
                               span<byte> scratch, report *details = nullptr) noexcept
    {
        static_assert(sizeof(instance) == sizeof(::hgrid_instance) && std::is_standard_layout<instance>::value &&
                          std::is_trivially_copyable<instance>::value,
                      "C reads arrays of them");
        scene built;
        const ::hgrid_config raw = how.c();
        const status answer =
            detail::said(::hgrid_build_scene(all.data(), all.size(), of.data(), of.size(), &raw, index.data(),
                                             index.size(), scratch.data(), scratch.size(), &built.raw_, details));
        return answer == status::ok ? result<scene>(built) : answer;
    }
    /// The scene refers to its objects: give them a name. The instances are copied.
    template <class Objects, std::enable_if_t<!detail::stays<Objects &&>::value, int> = 0>
    static result<scene> build(span<const instance>, Objects &&, const config &, span<byte>, span<byte>,
                               report * = nullptr) = delete;
    /// Opens a blob that was built with these objects.
    static result<scene> open(span<const byte> blob, span<const object> of) noexcept
    {
        scene opened;
        const status answer = detail::said(
            ::hgrid_open_scene(blob.data(), blob.size(), of.data(), of.size(), &opened.raw_));
        return answer == status::ok ? result<scene>(opened) : answer;
    }
    /// The scene refers to its blob and to its objects: give both a name.
    template <class Blob, class Objects = span<const object>,
              std::enable_if_t<!detail::stays<Blob &&>::value || !detail::stays<Objects &&>::value, int> = 0>
    static result<scene> open(Blob &&, Objects &&) = delete;
    /// Gives the scene in a blob other instances, as many as before, in place, as `view::refit` does.
    static result<scene> refit(span<const instance> all, span<const object> of, span<byte> blob,
                               refit_report *details = nullptr) noexcept
    {
        scene moved;
        const status answer = detail::said(::hgrid_refit_scene(all.data(), all.size(), of.data(), of.size(),
                                                               blob.data(), blob.size(), &moved.raw_, details));
        return answer == status::ok ? result<scene>(moved) : answer;
    }
    /// The scene refers to its objects: give them a name. The instances are copied.
    template <class Objects, std::enable_if_t<!detail::stays<Objects &&>::value, int> = 0>
    static result<scene> refit(span<const instance>, Objects &&, span<byte>, refit_report * = nullptr) = delete;
    /// Tells how much memory is enough for any scene of so many instances, with any configuration.
    static result<report> bound(std::size_t instances, const config &how) noexcept
    {
        const ::hgrid_config raw = how.c();
        report found;
        const status answer = detail::said(::hgrid_scene_bound(instances, &raw, &found));
        return answer == status::ok ? result<report>(found) : answer;
    }
    /// Proves that the blob is a scene of its objects, in scratch of `validate_bound` bytes.
    status validate(span<byte> scratch) const noexcept
    {
        return detail::said(::hgrid_validate_scene(&raw_, scratch.data(), scratch.size()));
    }
    /// Bytes that `pack` writes; 0 for a view of nothing, and for a scene that shows shapes.
    std::uint64_t packed_bytes() const noexcept
    {
        std::uint64_t bytes = 0;
        static_cast<void>(::hgrid_pack_scene(&raw_, nullptr, 0, &bytes));
        return bytes;
    }
    /// Writes the scene and all that it shows as one blob.
    status pack(span<byte> to) const noexcept
    {
        std::uint64_t bytes = 0;
        return detail::said(::hgrid_pack_scene(&raw_, to.data(), to.size(), &bytes));
    }
    /// The same in memory of its own.
    result<memory> pack() const noexcept
    {
        auto packed = memory::allocate(packed_bytes());
        if (!packed)
            return packed;
        const status answer = pack(*packed);
        return answer == status::ok ? std::move(packed) : answer;
    }
    /// Bytes that the views of a packed scene take; 0 for another blob, and for a scene without instances.
    static std::uint64_t view_bytes(span<const byte> blob) noexcept
    {
        std::uint64_t bytes = 0;
        scene opened;
        static_cast<void>(::hgrid_open_packed_scene(blob.data(), blob.size(), nullptr, 0, nullptr, 0, &bytes,
                                                    &opened.raw_));
        return bytes;
    }
    /// Opens what `pack` wrote, where it lies, with memory for its views, both of which stay where they are. With
    /// scratch, of which a 64th of the blob's bytes is enough, all that is in it is proven; without, nothing is.
    static result<scene> open_packed(span<const byte> blob, span<byte> views,
                                     span<byte> scratch = span<byte>()) noexcept
    {
        scene opened;
        std::uint64_t bytes = 0;
        const status answer =
            detail::said(::hgrid_open_packed_scene(blob.data(), blob.size(), views.data(), views.size(),
                                                   scratch.data(), scratch.size(), &bytes, &opened.raw_));
        return answer == status::ok ? result<scene>(opened) : answer;
    }
    /// A temporary would be freed at once: give the memory a name.
    template <class Blob, std::enable_if_t<!detail::stays<Blob &&>::value, int> = 0>
    static result<scene> open_packed(Blob &&, span<byte>, span<byte> = span<byte>()) = delete;
    /// The closest thing that a ray hits.
    optional<scene_hit> intersect(const ray_f64 &along) const noexcept { return intersect_in_c(along, nullptr); }
    /// The same with options.
    optional<scene_hit> intersect(const ray_f64 &along, const scene_options &with) const noexcept
    {
        return intersect_in_c(along, &with.c());
    }
    /// Returns true if a ray hits anything.
    bool occluded(const ray_f64 &along) const noexcept
    {
        return ::hgrid_occluded_scene(&raw_, &along, nullptr);
    }
    /// The same with options.
    bool occluded(const ray_f64 &along, const scene_options &with) const noexcept
    {
        return ::hgrid_occluded_scene(&raw_, &along, &with.c());
    }

    /// The closest hit of each ray; a miss has the primitive `invalid_id`. There are as many hits as rays, or the
    /// answer is `invalid_answers`.
    status intersect_n(strided<const ray_f64> rays, strided<scene_hit> hits, coherence know) const noexcept
    {
        return intersect_n_in_c(rays, hits, know, nullptr);
    }
    /// The same with options for all rays.
    status intersect_n(strided<const ray_f64> rays, strided<scene_hit> hits, coherence know,
                       const scene_options &with) const noexcept
    {
        return intersect_n_in_c(rays, hits, know, &with.c());
    }
    /// For each ray 1 if it hits anything, or else 0. There are as many answers as rays, or the answer is
    /// `invalid_answers`.
    status occluded_n(strided<const ray_f64> rays, strided<std::uint8_t> answers, coherence know) const noexcept
    {
        return occluded_n_in_c(rays, answers, know, nullptr);
    }
    /// The same with options for all rays.
    status occluded_n(strided<const ray_f64> rays, strided<std::uint8_t> answers, coherence know,
                      const scene_options &with) const noexcept
    {
        return occluded_n_in_c(rays, answers, know, &with.c());
    }
    /// The point where a ray met a triangle, its normal there, and origins for rays that leave it; `at` is
    /// what a query has found for the ray. Nothing where `hgrid_scene_surface_at` returns false.
    optional<scene_surface> surface_at(const ray_f64 &along, const scene_hit &at) const noexcept
    {
        scene_surface found;
        return ::hgrid_scene_surface_at(&raw_, &along, &at, &found) ? optional<scene_surface>(found)
                                                                    : optional<scene_surface>();
    }
    /// The normal of the triangle that was hit, of length 1, in the scene; zeros if the hit names none. This is right
    /// for flat triangles. A shape of yours has a normal that only you know: use the form below.
    point normal(const scene_hit &of) const noexcept
    {
        point found = {};
        static_cast<void>(::hgrid_scene_normal(&raw_, &of, nullptr, found.data()));
        return found;
    }
    /// A normal of the object that was hit, of any length, as it is in the scene, of length 1; zeros if the hit names
    /// nothing, or the normal is zero or not finite. This is right for shapes of yours, and for triangles with normals
    /// of their own at the vertices, however the instance turns, mirrors, shears or scales.
    point normal(const scene_hit &of, const point &object_normal) const noexcept
    {
        point found = {};
        static_cast<void>(::hgrid_scene_normal(&raw_, &of, object_normal.data(), found.data()));
        return found;
    }
    /// The instance at a level of the path of a hit, 0 the outermost. Nothing if the path has no such level, or the hit
    /// names nothing.
    optional<instance> instance_at(const scene_hit &of, std::uint32_t level) const noexcept
    {
        instance found(HGRID_INVALID_ID);
        return ::hgrid_scene_instance(&raw_, &of, level, &found) ? optional<instance>(found) : optional<instance>();
    }
    /// The innermost instance that a hit names; one of no object if it names none.
    instance instance_of(const scene_hit &of) const noexcept
    {
        instance found(HGRID_INVALID_ID);
        static_cast<void>(::hgrid_scene_locate(&raw_, &of, &found, nullptr));
        return found;
    }
    /// The grid that a hit names; a view of nothing if it names shapes or nothing.
    view grid_of(const scene_hit &of) const noexcept
    {
        ::hgrid_grid found = HGRID_GRID_INIT;
        static_cast<void>(::hgrid_scene_locate(&raw_, &of, nullptr, &found));
        return view(found);
    }
    /// The box of all instances and a little more: the least x, y and z, then the greatest.
    std::array<float, 6> box() const noexcept
    {
        std::array<float, 6> corners = {};
        static_cast<void>(::hgrid_box_of_scene(&raw_, corners.data()));
        return corners;
    }
    /// The struct that C takes.
    const ::hgrid_scene &c() const noexcept { return raw_; }

private:
    optional<scene_hit> intersect_in_c(const ray_f64 &along, const ::hgrid_scene_options *with) const noexcept
    {
        scene_hit found;
        return ::hgrid_intersect_scene(&raw_, &along, with, &found) ? optional<scene_hit>(found)
                                                                    : optional<scene_hit>();
    }
    status intersect_n_in_c(strided<const ray_f64> rays, strided<scene_hit> hits, coherence know,
                            const ::hgrid_scene_options *with) const noexcept
    {
        if (rays.size() != hits.size())
            return status::invalid_answers;
        return detail::said(::hgrid_intersect_scene_n(&raw_, rays.first(), rays.stride(), hits.first(), hits.stride(),
                                                      rays.size(), static_cast<::hgrid_coherence>(know), with));
    }
    status occluded_n_in_c(strided<const ray_f64> rays, strided<std::uint8_t> answers, coherence know,
                           const ::hgrid_scene_options *with) const noexcept
    {
        if (rays.size() != answers.size())
            return status::invalid_answers;
        return detail::said(::hgrid_occluded_scene_n(&raw_, rays.first(), rays.stride(), answers.first(),
                                                     answers.stride(), rays.size(),
                                                     static_cast<::hgrid_coherence>(know), with));
    }

    ::hgrid_scene raw_ = HGRID_SCENE_INIT;
};

/// Makes an object of a grid or view. It keeps the address: do not move the grid or view while a scene shows it. A
/// `std::vector` moves its elements when it grows.
inline result<object> make_object(const view &of) noexcept
{
    object made;
    const status answer = detail::said(::hgrid_object_grid(&of.c(), &made));
    return answer == status::ok ? result<object>(made) : answer;
}
/// Makes an object of a tree of shapes. It keeps the address: the tree stays where it is.
inline result<object> make_object(const shapes &of) noexcept
{
    object made;
    const status answer = detail::said(::hgrid_object_shapes(&of.c(), &made));
    return answer == status::ok ? result<object>(made) : answer;
}
/// Makes an object of a scene. It keeps the address: the scene stays where it is.
inline result<object> make_object(const scene &of) noexcept
{
    object made;
    const status answer = detail::said(::hgrid_object_scene(&of.c(), &made));
    return answer == status::ok ? result<object>(made) : answer;
}
/// An object refers to its view: give it a name.
result<object> make_object(const view &&) = delete;
/// The same.
result<object> make_object(const shapes &&) = delete;
/// The same.
result<object> make_object(const scene &&) = delete;

#if HGRID_CPP < 201703L
} // namespace cpp14
#endif
} // namespace hgrid

#undef HGRID_INLINE
#undef HGRID_NODISCARD
#undef HGRID_CPP

#endif
