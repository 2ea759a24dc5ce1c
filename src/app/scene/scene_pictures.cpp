#include "scene_pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <string_view>
#include <vector>

#include "../plot.hpp"

namespace ricochet::app {

namespace {

constexpr double longest_side = 900;  ///< [px]

struct Frame {
    Vector2 low{}, high{};
    [[nodiscard]] double width() const { return high[0] - low[0]; }
    [[nodiscard]] double height() const { return high[1] - low[1]; }
};

/// Displacements of a surface at the sample times; a single one if it is fixed, or without samples.
std::vector<Vector2> displacements(const Scene::Surface& surface, const SceneRun& run)
{
    if (std::holds_alternative<Fixed>(surface.motion)) return {{}};
    if (run.sample_times.empty()) return {displacement(surface.motion, run.t)};
    std::vector<Vector2> out;
    for (const double t : run.sample_times) out.push_back(displacement(surface.motion, t));
    return out;
}

/// The points of terrain; those of an arc at every third degree at least.
std::vector<Vector2> points_of(const Scene::Surface& surface)
{
    if (!surface.is_arc()) return surface.points;
    constexpr double turn = 2 * std::numbers::pi;
    const auto angle_of = [&](const Vector2& p) {
        return std::atan2(p[1] - surface.centre[1], p[0] - surface.centre[0]);
    };
    const double from = angle_of(surface.points.front());
    double sweep = angle_of(surface.points.back()) - from;
    if (sweep <= 0) sweep += turn;
    const auto count = static_cast<int>(std::ceil(120 * sweep / turn));
    std::vector<Vector2> points;
    for (int k = 0; k <= count; ++k) {
        const double angle = from + sweep * k / count;
        points.push_back({surface.centre[0] + surface.radius * std::cos(angle),
                          surface.centre[1] + surface.radius * std::sin(angle)});
    }
    return points;
}

/// The ends of a plate whose middle is at `at`.
std::array<Vector2, 2> ends_of(const Scene::PlateShape& plate, const Vector2& at)
{
    return {{{at[0] - plate.half[0], at[1] - plate.half[1]},
             {at[0] + plate.half[0], at[1] + plate.half[1]}}};
}

/// Widens the frame by the walls along its sides that are near.
void include_near_walls(const SceneFile& file, const SceneRun& run, Frame& frame)
{
    const double reach = 0.25 * std::max(frame.width(), frame.height());
    const Frame inner = frame;
    for (const Scene::Surface& surface : file.scene.surfaces()) {
        for (std::size_t c = 0; c < 2; ++c) {
            if (!surface.is_wall || surface.normal[1 - c] != 0) continue;
            for (const Vector2& moved : displacements(surface, run)) {
                const double at = surface.points[0][c] + moved[c];
                if (at < inner.low[c] - reach || at > inner.high[c] + reach) continue;
                frame.low[c] = std::min(frame.low[c], at);
                frame.high[c] = std::max(frame.high[c], at);
            }
        }
    }
}

/// A frame around all bodies and terrain shown, and the walls near them, with a margin.
Frame frame_of(const SceneFile& file, const SceneRun& run)
{
    constexpr double infinite = std::numeric_limits<double>::infinity();
    Frame frame{{infinite, infinite}, {-infinite, -infinite}};
    const auto include = [&](const Vector2& p, double radius) {
        for (std::size_t c = 0; c < 2; ++c) {
            frame.low[c] = std::min(frame.low[c], p[c] - radius);
            frame.high[c] = std::max(frame.high[c], p[c] + radius);
        }
    };
    const auto bodies = file.scene.bodies();
    const auto include_all = [&](const std::vector<BodyState>& states) {
        for (std::size_t i = 0; i < states.size(); ++i) include(states[i].at, bodies[i].radius);
        for (const auto& plate : file.scene.plates()) {
            for (const Vector2& end : ends_of(plate, states[plate.body].at)) include(end, 0);
        }
    };
    for (const auto& states : run.samples) include_all(states);
    include_all(run.bodies);
    for (const Scene::Surface& surface : file.scene.surfaces()) {
        if (surface.is_wall) continue;
        for (const Vector2& moved : displacements(surface, run)) {
            for (const Vector2& p : points_of(surface)) {
                include({p[0] + moved[0], p[1] + moved[1]}, 0);
            }
        }
    }
    if (!(frame.low[0] <= frame.high[0])) frame = {{-1, -1}, {1, 1}};
    include_near_walls(file, run, frame);
    const double margin = 0.04 * std::max({frame.width(), frame.height(), 1e-9});
    for (std::size_t c = 0; c < 2; ++c) {
        frame.low[c] -= margin;
        frame.high[c] += margin;
    }
    return frame;
}

/// A displaced surface as a chain of points; for a wall, the part inside the frame.
std::vector<Vector2> line_of(Scene::Surface surface, const Vector2& moved, const Frame& frame)
{
    surface.points = points_of(surface);
    for (Vector2& p : surface.points) p = {p[0] + moved[0], p[1] + moved[1]};
    if (!surface.is_wall) return surface.points;
    const Vector2 along{-surface.normal[1], surface.normal[0]};
    const Vector2& from = surface.points[0];
    double first = -std::numeric_limits<double>::infinity();
    double last = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < 2; ++c) {
        if (along[c] == 0) {
            if (from[c] < frame.low[c] || from[c] > frame.high[c]) return {};
            continue;
        }
        const auto [low, high] = std::minmax(
            {(frame.low[c] - from[c]) / along[c], (frame.high[c] - from[c]) / along[c]});
        first = std::max(first, low);
        last = std::min(last, high);
    }
    if (!(first < last)) return {};
    return {{from[0] + first * along[0], from[1] + first * along[1]},
            {from[0] + last * along[0], from[1] + last * along[1]}};
}

/// Places where bodies were struck, between the samples around that time.
std::string struck(const SceneRun& run)
{
    std::string out;
    for (const SceneEvent& event : run.events) {
        if (event.kind != SceneEvent::Kind::impact) continue;
        const auto next =
            std::ranges::upper_bound(run.sample_times, event.t) - run.sample_times.begin();
        const auto k = static_cast<std::size_t>(next);
        if (k == 0 || k >= run.sample_times.size()) continue;
        const double part =
            (event.t - run.sample_times[k - 1]) / (run.sample_times[k] - run.sample_times[k - 1]);
        const Vector2& a = run.samples[k - 1][event.body].at;
        const Vector2& b = run.samples[k][event.body].at;
        out += fmt::format("{:.6g} {:.6g}\n", a[0] + part * (b[0] - a[0]),
                           a[1] + part * (b[1] - a[1]));
    }
    return out;
}

/// Positions of one body in pixels, and the samples at which they are distinct.
struct Track {
    std::vector<std::array<double, 2>> at;
    std::vector<std::size_t> kept;
};

/// Keeps samples farther than half a pixel from the straight motion between the kept ones.
void keep_between(Track& track, const std::vector<double>& times, std::size_t first,
                  std::size_t last)
{
    std::size_t worst = first;
    double largest = 0.5;
    for (std::size_t k = first + 1; k < last; ++k) {
        const double part = (times[k] - times[first]) / (times[last] - times[first]);
        double apart = 0;
        for (std::size_t c = 0; c < 2; ++c) {
            const double line =
                track.at[first][c] + part * (track.at[last][c] - track.at[first][c]);
            apart = std::max(apart, std::fabs(track.at[k][c] - line));
        }
        if (apart > largest) {
            largest = apart;
            worst = k;
        }
    }
    if (worst == first) {
        track.kept.push_back(last);
        return;
    }
    keep_between(track, times, first, worst);
    keep_between(track, times, worst, last);
}

bool is_still(const Track& track)
{
    return track.kept.size() <= 2 && track.at.front() == track.at.back();
}

/// Length and key times of an animation, up to its values.
void key_times(fmt::memory_buffer& out, const Track& track, const std::vector<double>& times)
{
    const auto to = std::back_inserter(out);
    const double start = times.front();
    const double length = times.back() - start;
    fmt::format_to(to, " dur=\"{:.4g}s\" repeatCount=\"indefinite\" keyTimes=\"", length);
    for (const std::size_t k : track.kept) {
        const bool last = k + 1 == times.size();
        fmt::format_to(to, "{}{:.5g}", k == 0 ? "" : ";", last ? 1 : (times[k] - start) / length);
    }
    fmt::format_to(to, "\" values=\"");
}

/// Animates a surface that moves without turning.
void animate_shift(fmt::memory_buffer& out, const Track& track, const std::vector<double>& times)
{
    const auto to = std::back_inserter(out);
    fmt::format_to(to, "<animateTransform attributeName=\"transform\" type=\"translate\"");
    key_times(out, track, times);
    for (const std::size_t k : track.kept) {
        fmt::format_to(to, "{}{:.1f} {:.1f}", k == 0 ? "" : ";", track.at[k][0], track.at[k][1]);
    }
    fmt::format_to(to, "\"/>");
}

/// Draws a line [px], which is displaced by the entries of `track`.
void draw_line(fmt::memory_buffer& out, const std::vector<std::array<double, 2>>& line, Track track,
               const std::vector<double>& times)
{
    const auto to = std::back_inserter(out);
    fmt::format_to(to, "<polyline points=\"");
    for (const auto& [x, y] : line) fmt::format_to(to, "{:.1f},{:.1f} ", x, y);
    fmt::format_to(to, "\"");
    track.kept.push_back(0);
    if (track.at.size() > 1) keep_between(track, times, 0, track.at.size() - 1);
    if (track.at.size() < 2 || is_still(track)) {
        fmt::format_to(to, "/>\n");
        return;
    }
    fmt::format_to(to, ">");
    animate_shift(out, track, times);
    fmt::format_to(to, "</polyline>\n");
}

void animate(fmt::memory_buffer& out, std::string_view attribute, const Track& track,
             std::size_t coordinate, const std::vector<double>& times)
{
    const auto to = std::back_inserter(out);
    fmt::format_to(to, "<animate attributeName=\"{}\"", attribute);
    key_times(out, track, times);
    for (const std::size_t k : track.kept) {
        fmt::format_to(to, "{}{:.1f}", k == 0 ? "" : ";", track.at[k][coordinate]);
    }
    fmt::format_to(to, "\"/>");
}

}  // namespace

void plot_scene(const SceneFile& file, const SceneRun& run, const std::filesystem::path& picture)
{
    const Frame frame = frame_of(file, run);
    std::string ways;
    std::string discs;
    std::string surfaces;
    const auto bodies = file.scene.bodies();
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        for (const auto& states : run.samples) {
            ways += fmt::format("{:.6g} {:.6g}\n", states[i].at[0], states[i].at[1]);
        }
        ways += '\n';
        if (file.scene.plate_of(static_cast<std::uint32_t>(i))) continue;
        const double shown = std::max(bodies[i].radius, 0.004 * frame.width());
        discs +=
            fmt::format("{:.6g} {:.6g} {:.6g}\n", run.bodies[i].at[0], run.bodies[i].at[1], shown);
    }
    for (const Scene::Surface& surface : file.scene.surfaces()) {
        const Vector2 moved = displacements(surface, run).back();
        for (const Vector2& p : line_of(surface, moved, frame)) {
            surfaces += fmt::format("{:.6g} {:.6g}\n", p[0], p[1]);
        }
        surfaces += '\n';
    }
    for (const auto& plate : file.scene.plates()) {
        for (const Vector2& end : ends_of(plate, run.bodies[plate.body].at)) {
            surfaces += fmt::format("{:.6g} {:.6g}\n", end[0], end[1]);
        }
        surfaces += '\n';
    }
    const double scale = longest_side / std::max(frame.width(), frame.height());
    std::string script = plot_head(picture, static_cast<int>(180 + scale * frame.width()),
                                   static_cast<int>(140 + scale * frame.height()));
    script += fmt::format(
        "set size ratio -1\nset xrange [{}:{}]\nset yrange [{}:{}]\nset clip two\n"
        "set xlabel 'x [m]'\nset ylabel 'y [m]'\nset key off\n"
        "set style fill transparent solid 0.35 border rgb '#404040'\n",
        frame.low[0], frame.high[0], frame.low[1], frame.high[1]);
    const std::string marks = struck(run);
    script += "plot 'ways' with lines linecolor rgb '#8fb8d6' linewidth 1";
    if (!discs.empty()) script += ", 'discs' with circles linecolor rgb '#0072b2'";
    if (surfaces.find_first_not_of('\n') != std::string::npos) {
        script += ", 'surfaces' with lines linecolor rgb '#404040' linewidth 3";
    }
    if (!marks.empty()) script += ", 'struck' with points linestyle 12 pointsize 0.3";
    draw({{"ways", ways}, {"discs", discs}, {"surfaces", surfaces}, {"struck", marks}},
         script + "\n", picture);
}

std::string animated_scene(const SceneFile& file, const SceneRun& run)
{
    const Frame frame = frame_of(file, run);
    const double scale = longest_side / std::max(frame.width(), frame.height());
    const auto pixel = [&](const Vector2& p) {
        return std::array{scale * (p[0] - frame.low[0]), scale * (frame.high[1] - p[1])};
    };
    fmt::memory_buffer out;
    const auto to = std::back_inserter(out);
    fmt::format_to(to,
                   "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\">\n"
                   "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
                   "<g fill=\"none\" stroke=\"#404040\" stroke-width=\"3\">\n",
                   scale * frame.width(), scale * frame.height());
    for (const Scene::Surface& surface : file.scene.surfaces()) {
        const auto moved = displacements(surface, run);
        const auto points = line_of(surface, moved.front(), frame);
        if (points.empty()) continue;
        std::vector<std::array<double, 2>> line;
        for (const Vector2& p : points) line.push_back(pixel(p));
        Track track;
        for (const Vector2& d : moved) {
            track.at.push_back(
                {scale * (d[0] - moved.front()[0]), scale * (moved.front()[1] - d[1])});
        }
        draw_line(out, line, track, run.sample_times);
    }
    for (const auto& plate : file.scene.plates()) {
        Track track;
        for (const auto& states : run.samples) track.at.push_back(pixel(states[plate.body].at));
        if (track.at.empty()) track.at.push_back(pixel(run.bodies[plate.body].at));
        const std::array<double, 2> middle = track.at.front();
        const std::array half{scale * plate.half[0], -scale * plate.half[1]};
        for (auto& at : track.at) at = {at[0] - middle[0], at[1] - middle[1]};
        draw_line(out,
                  {{middle[0] - half[0], middle[1] - half[1]},
                   {middle[0] + half[0], middle[1] + half[1]}},
                  track, run.sample_times);
    }
    fmt::format_to(to, "</g>\n<g stroke=\"#404040\" fill-opacity=\"0.7\">\n");
    constexpr std::array colours{"#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9"};
    for (std::size_t i = 0; i < run.bodies.size(); ++i) {
        if (file.scene.plate_of(static_cast<std::uint32_t>(i))) continue;
        Track track;
        for (const auto& states : run.samples) track.at.push_back(pixel(states[i].at));
        if (track.at.empty()) track.at.push_back(pixel(run.bodies[i].at));
        track.kept.push_back(0);
        if (track.at.size() > 1) keep_between(track, run.sample_times, 0, track.at.size() - 1);
        fmt::format_to(to, "<circle r=\"{:.1f}\" cx=\"{:.1f}\" cy=\"{:.1f}\" fill=\"{}\"",
                       std::max(2.0, scale * file.scene.bodies()[i].radius), track.at[0][0],
                       track.at[0][1], colours[i % colours.size()]);
        fmt::format_to(to, "{}", is_still(track) ? "/>\n" : ">");
        if (is_still(track)) continue;
        animate(out, "cx", track, 0, run.sample_times);
        animate(out, "cy", track, 1, run.sample_times);
        fmt::format_to(to, "</circle>\n");
    }
    fmt::format_to(to, "</g>\n</svg>\n");
    return fmt::to_string(out);
}

}  // namespace ricochet::app
