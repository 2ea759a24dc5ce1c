#include "ensemble_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "../input.hpp"
#include "../joined.hpp"
#include "../plot.hpp"

namespace ricochet::app {

namespace {

constexpr std::size_t most_panels = 8;
constexpr std::size_t most_components = 4;
constexpr double none = std::numeric_limits<double>::quiet_NaN();

std::string label(const Field& field)
{
    const std::string name = printable(field.name);
    return single_quoted(
        field.unit.empty() || field.unit == "1" ? name : fmt::format("{} [{}]", name, field.unit));
}

std::vector<double> numbers_of(const std::vector<Field>& fields, RowReader& row)
{
    std::vector<double> out;
    for (const Field& field : fields) {
        switch (field.kind) {
            case FieldKind::count: out.push_back(static_cast<double>(row.count())); break;
            case FieldKind::number: out.push_back(row.number()); break;
            case FieldKind::text:
                static_cast<void>(row.text());
                out.push_back(none);
                break;
        }
    }
    return out;
}

/// The points of each panel, and the range of what is across.
struct Points {
    std::vector<std::string> panels;
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
};

Points points_of(const EnsemblePicture& picture, const std::vector<Field>& fields,
                 const AllBlocks& blocks)
{
    Points out;
    out.panels.resize(picture.panels.size());
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        const std::string bytes = blocks.rows(b);
        for (RowReader reader(bytes); !reader.is_at_end();) {
            const std::vector<double> row = numbers_of(fields, reader);
            const double x = row[picture.across];
            if (!std::isfinite(x)) continue;
            out.low = std::min(out.low, x);
            out.high = std::max(out.high, x);
            for (std::size_t k = 0; k < picture.panels.size(); ++k) {
                for (const std::size_t result : picture.panels[k]) {
                    if (!std::isfinite(row[result])) continue;
                    out.panels[k] += fmt::format("{} {} {}\n", x, row[result], row[picture.colour]);
                }
            }
        }
    }
    return out;
}

}  // namespace

EnsemblePicture ensemble_picture(const std::vector<Field>& fields, std::size_t columns,
                                 const std::vector<std::string>& show)
{
    EnsemblePicture out{.across = columns > 0 ? 1U : 0U, .colour = columns > 1 ? 2U : 0U};
    std::vector<std::string> known;
    std::vector<std::size_t> events;
    std::vector<std::size_t> components;
    for (std::size_t k = columns + 1; k < fields.size(); ++k) {
        const Field& field = fields[k];
        if (field.kind == FieldKind::text) continue;
        known.push_back(field.name);
        if (field.name.starts_with("event_")) events.push_back(k);
        const bool final = field.kind == FieldKind::number && field.name.ends_with("_final");
        if (final && field.name != "t_final") components.push_back(k);
    }
    if (show.size() > most_panels) {
        throw BadInput(fmt::format("--show: {} results are named; expected {} at most", show.size(),
                                   most_panels));
    }
    for (const std::string& name : show) {
        const auto found = std::ranges::find_if(fields, [&](const Field& field) {
            return field.name == name && field.kind != FieldKind::text;
        });
        const auto place = static_cast<std::size_t>(found - fields.begin());
        if (found == fields.end() || place <= columns) {
            throw BadInput(fmt::format("--show: '{}' is not a result; expected some of {}",
                                       shortened(name), joined(known, ", ")));
        }
        out.panels.push_back({place});
    }
    if (!show.empty()) return out;
    if (!events.empty()) {
        out.panels.push_back(events);
        return out;
    }
    components.resize(std::min(components.size(), most_components));
    for (const std::size_t place : components) out.panels.push_back({place});
    return out;
}

void plot_ensemble(const EnsemblePicture& picture, const std::vector<Field>& fields,
                   const std::string& title, const AllBlocks& blocks,
                   const std::filesystem::path& file)
{
    const Points points = points_of(picture, fields, blocks);
    const std::size_t panels = picture.panels.size();
    std::string script = plot_head(file, 1200, static_cast<int>(160 + 420 * panels));
    script += fmt::format(
        "set multiplot layout {},1 title {}\n"
        "set key off\nset lmargin 15\nset rmargin {}\nset tmargin 2.5\n"
        "set offsets graph 0, graph 0, graph 0.06, graph 0.06\n",
        panels, single_quoted(printable(title)), picture.colour > 0 ? 16 : 3);
    if (points.low < points.high) {
        script += fmt::format("set xrange [{}:{}]\n", points.low, points.high);
        if (points.low > 0 && points.high >= 1000 * points.low) script += "set logscale x\n";
    }
    if (picture.colour > 0) {
        script += fmt::format("set cblabel {}\n", label(fields[picture.colour]));
    }
    PlotFiles files;
    for (std::size_t k = 0; k < panels; ++k) {
        if (k + 1 == panels)
            script += fmt::format("set xlabel {}\n", label(fields[picture.across]));
        const std::vector<std::size_t>& shown = picture.panels[k];
        const Field& first = fields[shown.front()];
        script += fmt::format("set ylabel {}\n", shown.size() > 1
                                                     ? label({.name = "events", .unit = first.unit})
                                                     : label(first));
        const std::string name = fmt::format("points{}", k);
        files.emplace_back(name, points.panels[k]);
        if (points.panels[k].empty()) {
            script +=
                "set yrange [0:1]\nset label 1 'no result is finite' at graph 0.4, 0.5\n"
                "plot NaN\nunset label 1\nset yrange [*:*]\n";
            continue;
        }
        script += fmt::format("plot '{}' using 1:2{} with points pointtype 7 pointsize 0.3 {}\n",
                              name, picture.colour > 0 ? ":3" : "",
                              picture.colour > 0 ? "linecolor palette" : "linecolor rgb '#0072b2'");
    }
    draw(files, script + "unset multiplot\n", file);
}

}  // namespace ricochet::app
