// ricochet_report_draw: draws panels given as JSON on standard input, in the style of all figures
// of ricochet.
//
//     ricochet_report_draw <file.svg>
//
//     {"title": ..., "panels": [{"title": ..., "x": ..., "y": ..., "log_x": true, "log_y": true,
//      "curves": [{"name": ..., "dashed": false, "points": false, "x": [...], "y": [...]}],
//      "tiles": {"x": [...], "y": [...], "value": [...]}}]}
//
// Tiles are optional, and bear their numbers; curves of a panel with tiles are in its columns and
// rows, 0, 1, ...
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <iostream>

#include "studies/exhibit.hpp"

namespace ricochet::app {

namespace {

Curve::Style style_of(const Json& curve)
{
    if (curve.value("points", false)) return Curve::Style::points;
    return curve.value("dashed", false) ? Curve::Style::marked_dashed : Curve::Style::marked;
}

Exhibit exhibit_of(const Json& given)
{
    Exhibit out;
    for (const Json& panel : given.at("panels")) {
        Panel& to = out.panels.emplace_back();
        to.title = panel.at("title");
        to.x_label = panel.at("x");
        to.y_label = panel.at("y");
        to.log_x = panel.value("log_x", true);
        to.log_y = panel.value("log_y", true);
        if (panel.contains("tiles")) {
            const Json& tiles = panel.at("tiles");
            to.tiles = Tiles{.x = tiles.at("x"),
                             .y = tiles.at("y"),
                             .value = tiles.at("value"),
                             .numbered = true,
                             .log_colour = true};
        }
        for (const Json& curve : panel.at("curves")) {
            to.curves.push_back({.name = curve.at("name"),
                                 .x = curve.at("x"),
                                 .y = curve.at("y"),
                                 .style = style_of(curve),
                                 .colour = curve.value("colour", -1)});
        }
    }
    return out;
}

}  // namespace

}  // namespace ricochet::app

int main(int argc, char** argv)
{
    try {
        if (argc != 2) {
            fmt::print(stderr, "usage: ricochet_report_draw <file.svg> < panels.json\n");
            return 2;
        }
        const auto given = ricochet::app::Json::parse(std::cin);
        ricochet::app::draw(ricochet::app::exhibit_of(given), given.at("title"), argv[1]);
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_report_draw: {}\n", error.what());
        return 1;
    }
}
