#include "exhibit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "interrupt.hpp"
#include "plot.hpp"

namespace ricochet::app {

namespace {

/// Quotes a text for gnuplot.
std::string in_quotes(std::string_view text)
{
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
    return out + '\'';
}

std::string number(double value, std::string_view format)
{
    return std::isnan(value) ? "-" : fmt::format(fmt::runtime(format), value);
}

/// x, y by line; a value that is not finite interrupts the line.
std::string data(const Curve& curve)
{
    std::string out;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
        out += std::isfinite(curve.y[i]) ? fmt::format("{} {}\n", curve.x[i], curve.y[i]) : "\n";
    }
    return out;
}

/// Lines with column, row, value and label.
std::string data(const Tiles& tiles)
{
    std::string out;
    for (std::size_t j = 0; j < tiles.y.size(); ++j) {
        for (std::size_t i = 0; i < tiles.x.size(); ++i) {
            const double value = tiles.value[j * tiles.x.size() + i];
            out += fmt::format("{} {} {} {}\n", i, j,
                               std::isnan(value) ? "NaN" : fmt::format("{}", value),
                               std::isnan(value) ? "N/A" : fmt::format("{:.3g}", value));
        }
    }
    return out;
}

std::string style(const Curve& curve, std::size_t which)
{
    const std::size_t index = curve.colour < 0 ? which : static_cast<std::size_t>(curve.colour);
    const std::string line = curve.published ? std::string("linecolor rgb '#000000'")
                                             : fmt::format("linestyle {}", index % 6 + 1);
    switch (curve.style) {
        case Curve::Style::line: return fmt::format("lines {} dashtype 1 linewidth 2", line);
        case Curve::Style::dashed: return fmt::format("lines {} dashtype 2 linewidth 2", line);
        case Curve::Style::points: return fmt::format("points {} pointsize 0.6", line);
        case Curve::Style::crosses:
            return fmt::format("points {} pointtype 2 pointsize 0.9 linewidth 1.5", line);
        case Curve::Style::marked:
            return fmt::format("linespoints {} dashtype 1 linewidth 2.5 pointtype {} pointsize 0.7",
                               line, index + 4);
        case Curve::Style::marked_dashed:
            return fmt::format("linespoints {} dashtype 2 linewidth 1.5 pointtype {} pointsize 0.7",
                               line, index + 4);
    }
    return "lines";
}

/// At most eight tics with the numbers of a grid, whose cells are drawn at 0, 1, ...
std::string tics(std::string_view axis, const std::vector<double>& at)
{
    std::vector<std::string> out;
    const std::size_t every = 1 + (at.size() - 1) / 8;
    for (std::size_t i = 0; i < at.size(); i += every) {
        out.push_back(fmt::format("'{:.3g}' {}", at[i], i));
    }
    return fmt::format("set {}tics ({})\n", axis, fmt::join(out, ", "));
}

/// The script of one panel; its data go to `files`.
std::string script(const Panel& panel, std::size_t which, PlotFiles& files)
{
    std::string out = fmt::format(
        "set title {}\nset xlabel {}.\"\\n\"\nset ylabel {}\n{}set logscale x\n{}set logscale "
        "y\nset yrange [*:*] {}reverse\n",
        in_quotes(panel.title), in_quotes(panel.x_label), in_quotes(panel.y_label),
        panel.log_x ? "" : "un", panel.log_y ? "" : "un", panel.downwards ? "" : "no");
    std::vector<std::string> parts;
    if (panel.tiles) {
        const std::string file = fmt::format("tiles{}", which);
        files.emplace_back(file, data(*panel.tiles));
        out += tics("x", panel.tiles->x) + tics("y", panel.tiles->y) +
               fmt::format("unset grid\n{}set logscale cb\n", panel.tiles->log_colour ? "" : "un");
        parts.push_back(fmt::format("'{}' using 1:2:3 with image pixels notitle", file));
        if (panel.tiles->numbered) {
            parts.push_back(fmt::format("'{}' using 1:2:4 with labels notitle", file));
        }
    } else {
        out += "set xtics autofreq\nset ytics autofreq\nset grid\n";
    }
    for (std::size_t i = 0; i < panel.curves.size(); ++i) {
        const Curve& curve = panel.curves[i];
        const std::string file = fmt::format("curve{}-{}", which, i);
        files.emplace_back(file, data(curve));
        parts.push_back(fmt::format("'{}' using 1:2 with {} title {}", file, style(curve, i),
                                    in_quotes(curve.name)));
    }
    return out + fmt::format("plot {}\n", fmt::join(parts, ", \\\n     "));
}

Json json(const std::vector<double>& values)
{
    return Json(values);
}

Json json(const Panel& panel)
{
    Json out{{"title", panel.title}, {"x", panel.x_label}, {"y", panel.y_label}};
    out["curves"] = Json::array();
    for (const Curve& curve : panel.curves) {
        out["curves"].push_back({{"name", curve.name},
                                 {"published", curve.published},
                                 {"x", json(curve.x)},
                                 {"y", json(curve.y)}});
    }
    if (panel.tiles) {
        out["tiles"] = {{"x", json(panel.tiles->x)},
                        {"y", json(panel.tiles->y)},
                        {"value", json(panel.tiles->value)}};
    }
    return out;
}

}  // namespace

std::string_view name(ExhibitKind kind) noexcept
{
    return kind == ExhibitKind::table ? "table" : "figure";
}

void check_exhibit()
{
    if (Interrupts::any()) throw ExhibitInterrupted{};
}

std::vector<double> even(double first, double last, std::size_t count)
{
    std::vector<double> out(count);
    for (std::size_t i = 0; i < count; ++i) {
        out[i] = std::lerp(first, last, static_cast<double>(i) / static_cast<double>(count - 1));
    }
    return out;
}

std::vector<double> geometric(double first, double last, std::size_t count)
{
    std::vector<double> out = even(std::log(first), std::log(last), count);
    for (double& value : out) value = std::exp(value);
    return out;
}

std::string to_text(const Exhibit& exhibit)
{
    std::size_t wide = 0;
    for (const ExhibitRow& row : exhibit.rows) wide = std::max(wide, row.name.size() + 7);
    std::vector<std::size_t> width;
    for (std::size_t k = 0; k < exhibit.columns.size(); ++k) {
        std::size_t most = exhibit.columns[k].size();
        for (const ExhibitRow& row : exhibit.rows) {
            most = std::max(most, number(row.value[k], exhibit.format).size());
        }
        width.push_back(most + 2);
    }
    std::string out;
    if (!exhibit.rows.empty()) {
        out += fmt::format("{:<{}}", "", wide);
        for (std::size_t k = 0; k < width.size(); ++k) {
            out += fmt::format("{:>{}}", exhibit.columns[k], width[k]);
        }
        out += '\n';
    }
    for (const ExhibitRow& row : exhibit.rows) {
        out += fmt::format("{:<{}}", (row.published ? "paper: " : "") + row.name, wide);
        for (std::size_t k = 0; k < width.size(); ++k) {
            out += fmt::format("{:>{}}", number(row.value[k], exhibit.format), width[k]);
        }
        out += '\n';
    }
    for (const Agreement& a : exhibit.agreements) {
        out += fmt::format("{}: ours {:.6g}, {}held to [{:.4g}, {:.4g}]: {}\n", a.what, a.ours,
                           std::isnan(a.paper) ? "" : fmt::format("paper {:.6g}, ", a.paper),
                           a.lower, a.upper, a.holds() ? "yes" : "NO");
    }
    if (!exhibit.remark.empty()) out += exhibit.remark + '\n';
    return out;
}

Json to_json(const Exhibit& exhibit)
{
    Json out{{"columns", exhibit.columns}};
    out["rows"] = Json::array();
    for (const ExhibitRow& row : exhibit.rows) {
        out["rows"].push_back(
            {{"name", row.name}, {"published", row.published}, {"values", json(row.value)}});
    }
    out["agreements"] = Json::array();
    for (const Agreement& a : exhibit.agreements) {
        out["agreements"].push_back({{"what", a.what},
                                     {"ours", a.ours},
                                     {"paper", a.paper},
                                     {"lower", a.lower},
                                     {"upper", a.upper},
                                     {"holds", a.holds()}});
    }
    out["panels"] = Json::array();
    for (const Panel& panel : exhibit.panels) out["panels"].push_back(json(panel));
    out["remark"] = exhibit.remark;
    return out;
}

void draw(const Exhibit& exhibit, const std::string& title, const std::filesystem::path& file)
{
    const std::size_t count = exhibit.panels.size();
    const std::size_t across = count < 3 ? count : (count + 1) / 2;
    const std::size_t down = (count + across - 1) / across;
    std::size_t curves = 0;
    for (const Panel& panel : exhibit.panels) curves = std::max(curves, panel.curves.size());
    const std::size_t key = curves > 6 ? 26 * (curves - 2) : 0;  // a line each
    // An empty line between the label of the axis and the key below it takes 22 pixels, a title 45.
    const std::size_t top = title.empty() ? 15 : 60;
    const std::string heading =
        title.empty() ? "" : fmt::format(" title {}.\"\\n\"", in_quotes(title));
    std::string out =
        plot_head(file, static_cast<int>(620 * across), static_cast<int>(top + (442 + key) * down));
    out += fmt::format(
        "set multiplot layout {},{}{}\nset format x '%g'\nset format y '%g'\nset "
        "key below samplen 2 "
        "spacing 1.1\n"
        "set palette defined (0 '#f4f8fb', 0.5 '#7fb0d6', 1 '#1f5fa8')\nset datafile missing "
        "'NaN'\n"
        "set offsets graph 0, graph 0, graph 0.06, graph 0.02\n",
        down, across, heading);
    PlotFiles files;
    for (std::size_t i = 0; i < count; ++i) out += script(exhibit.panels[i], i, files);
    ricochet::app::draw(files, out + "unset multiplot\n", file);
}

}  // namespace ricochet::app
