// Describes how a scene would be run, and which tests would be skipped.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "ricochet/scene/simulate.hpp"
#include "scene/groups.hpp"
#include "scene/islands.hpp"
#include "scene/options.hpp"
#include "scene/scene_loop.hpp"

namespace ricochet {

using namespace detail;

namespace {

constexpr std::size_t most_lines = 12;
constexpr std::size_t most_pairs = 20'000;

std::string plural(std::size_t n, std::string_view one)
{
    return fmt::format("{} {}{}", n, one, n == 1 ? "" : "s");
}

std::string motion_of(const World& world, std::span<const std::uint32_t> group)
{
    const Body& body = world.bodies[group[0]];
    if (body.asleep) return "at rest";
    if (is_zero(body.a)) return is_zero(body.v) ? "at rest" : "straight, closed form";
    return "parabola, closed form";
}

/// The first meeting of two bodies of a group as they move now, as if there were no surfaces.
std::string first_meeting(const World& world, std::span<const std::uint32_t> group)
{
    if (world.periodic || group.size() * group.size() > most_pairs) return "";
    Instant first = no_instant;
    std::uint32_t a = none;
    std::uint32_t b = none;
    for (std::size_t x = 0; x < group.size(); ++x) {
        for (std::size_t y = 0; y < x; ++y) {
            const Body& one = world.bodies[group[x]];
            const Body& two = world.bodies[group[y]];
            if (one.island != none || two.island != none) continue;
            if (world.plate(group[x]) || world.plate(group[y])) continue;
            const Meeting meeting = meet(world, group[y], group[x]);
            const Instant t = meeting.from.after(meeting.after);
            if (meeting.after < never && before(t, first)) {
                first = t;
                a = group[y];
                b = group[x];
            }
        }
    }
    if (a == none || first.value > world.options.t_end) return "";
    return fmt::format(R"(; on their present flights "{}" meets "{}" first, at t = {:.6g} s)",
                       world.scene.name_of(BodyId{a}), world.scene.name_of(BodyId{b}), first.value);
}

std::string names(const World& world, std::span<const std::uint32_t> group)
{
    std::string text = fmt::format("\"{}\"", world.scene.name_of(BodyId{group[0]}));
    for (std::size_t k = 1; k < std::min<std::size_t>(group.size(), 3); ++k) {
        text += fmt::format(" + \"{}\"", world.scene.name_of(BodyId{group[k]}));
    }
    return group.size() > 3 ? fmt::format("{} + {} more", text, group.size() - 3) : text;
}

void describe_islands(const World& world, fmt::memory_buffer& out)
{
    const std::size_t count = world.islands->count();
    for (std::size_t k = 0; k < std::min(count, most_lines); ++k) {
        const auto& members = world.islands->members(static_cast<std::uint32_t>(k));
        fmt::format_to(std::back_inserter(out),
                       "  island {}   {}   own steps of dopri5, rtol {:g}\n", k + 1,
                       names(world, members), world.options.rtol);
    }
    if (count > most_lines) {
        fmt::format_to(std::back_inserter(out), "  and {} more islands with steps of their own\n",
                       count - most_lines);
    }
}

struct GroupCounts {
    std::size_t asleep = 0, alone = 0;  ///< bodies that are groups of their own
    double pairs = 0;                   ///< within groups
};

GroupCounts describe_groups(const World& world, fmt::memory_buffer& out)
{
    const auto groups = groups_of(world);
    const auto to = std::back_inserter(out);
    GroupCounts counts;
    std::size_t lines = 0;
    for (std::size_t number = 0; number < groups.size(); ++number) {
        const auto group = groups[number];
        const auto size = static_cast<double>(group.size());
        counts.pairs += 0.5 * size * (size - 1);
        const bool sleeps = group.size() == 1 && world.bodies[group[0]].asleep;
        counts.asleep += sleeps;
        counts.alone += group.size() == 1 && !sleeps;
        if (sleeps || ++lines > most_lines) continue;
        if (group.size() == 1) {
            fmt::format_to(to, "  {}   {}; meets no other body: runs alone, no calendar\n",
                           names(world, group), motion_of(world, group));
            continue;
        }
        const auto awake = static_cast<std::size_t>(
            std::ranges::count_if(group, [&](std::uint32_t i) { return !world.bodies[i].asleep; }));
        fmt::format_to(to, "  {}   {} of {} awake, may meet before t_end: calendar, cells{}\n",
                       names(world, group), awake, group.size(), first_meeting(world, group));
    }
    if (lines > most_lines) {
        fmt::format_to(to, "  and {} more groups\n", lines - most_lines);
    }
    return counts;
}

}  // namespace

std::string explain(const Scene& scene, const SceneOptions& options)
{
    validate(options);
    scene.check(options.t_start);
    scene.require_room(0);
    World world(scene, options);
    fmt::memory_buffer out;
    const auto to = std::back_inserter(out);
    const std::size_t n = world.bodies.size();
    const auto is_wall = [](const Scene::Surface& s) { return s.is_wall; };
    const auto walls = static_cast<std::size_t>(std::ranges::count_if(scene.surfaces(), is_wall));
    fmt::format_to(to, "{}, {}, {}, {}, {} of terrain\n",
                   n == 1 ? "1 body" : fmt::format("{} bodies", n), plural(walls, "wall"),
                   plural(scene.springs().size(), "spring"),
                   plural(world.islands->count(), "island"),
                   plural(world.fixed_count - world.wall_count, "piece"));
    if (!world.plates.empty()) {
        fmt::format_to(to, "  {} of the bodies; every other body is tested against {}\n",
                       plural(world.plates.size(), "plate"),
                       world.plates.size() == 1 ? "it" : "each");
    }
    describe_islands(world, out);
    if (!world.motions.empty()) {
        const bool one = world.motions.size() == 1;
        fmt::format_to(to, "  {}; contacts with {} are searched for by bounds on {} motion\n",
                       plural(world.motions.size(), "moving face"), one ? "it" : "them",
                       one ? "its" : "their");
    }
    const GroupCounts counts = describe_groups(world, out);
    const double all = 0.5 * static_cast<double>(n) * (static_cast<double>(n) - 1);
    fmt::format_to(
        to, "asleep      {}, until touched; no event of theirs is expected\n",
        n == 1 ? plural(counts.asleep, "body") : fmt::format("{} bodies alone", counts.asleep));
    fmt::format_to(to, "skipped     {:.0f} of {:.0f} pairs: out of reach before t_end\n",
                   all - counts.pairs, all);
    fmt::format_to(to, "alone       {} awake, no calendar\n", counts.alone);
    fmt::format_to(
        to, "impacts     {}; {}\n",
        options.impacts == ImpactLaw::waves ? "in waves" : "all of a cluster together",
        options.contacts ? "bodies in lasting contact by set-valued steps" : "no set-valued steps");
    fmt::format_to(to, "memory      {:.3g} MB without events and samples\n", scene.memory() * 1e-6);
    return fmt::to_string(out);
}

}  // namespace ricochet
