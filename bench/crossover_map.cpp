// Writes a map of the fastest way of checking a guard, as SVG.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include "crossover.hpp"

namespace ricochet::bench {

namespace {

constexpr int cell_width = 92;
constexpr int cell_height = 30;
constexpr int left = 250;
constexpr int top = 60;

std::string_view colour_of(std::string_view way)
{
    if (way == "planned") return "#7fb3d5";
    if (way == "network") return "#f5b041";
    if (way == "every step") return "#d5d8dc";
    return "#a9dfbf";  // every k
}

std::string text(int x, int y, std::string_view anchor, std::string_view words)
{
    return fmt::format("<text x='{}' y='{}' text-anchor='{}'>{}</text>\n", x, y, anchor, words);
}

std::string cell(int column, int y, const Regime& regime, double price)
{
    const Way& way = best_way(regime, price, true);
    const double gain = regime.ways.front().cost(price) / way.cost(price);
    const int x = left + column * cell_width;
    return fmt::format("<rect x='{}' y='{}' width='{}' height='{}' fill='{}' stroke='white'/>\n", x,
                       y, cell_width, cell_height, colour_of(way.name)) +
           text(x + cell_width / 2, y + 19, "middle", fmt::format("{} {:.3g}x", way.name, gain));
}

}  // namespace

void write_map(const std::string& file, const std::vector<Regime>& regimes,
               const std::vector<double>& prices)
{
    std::vector<const Regime*> rows;
    for (const Regime& regime : regimes) rows.push_back(&regime);
    std::stable_sort(rows.begin(), rows.end(), [](const Regime* a, const Regime* b) {
        return std::tuple(a->opaque, a->dimension, a->rate) <
               std::tuple(b->opaque, b->dimension, b->rate);
    });
    std::string body;
    for (std::size_t c = 0; c < prices.size(); ++c) {
        const int x = left + static_cast<int>(c) * cell_width + cell_width / 2;
        body += text(x, top - 8, "middle",
                     prices[c] == 0 ? "as it is" : fmt::format("+{:.6g} us", 1e6 * prices[c]));
    }
    int y = top;
    const Regime* before = nullptr;
    for (const Regime* row : rows) {
        if (before == nullptr || before->opaque != row->opaque ||
            before->dimension != row->dimension) {
            y += 24;
            body += text(8, y - 7, "start",
                         fmt::format("{} components, {}", row->dimension,
                                     row->opaque ? "only the sign is known" : "bounds are known"));
        }
        before = row;
        body += text(left - 8, y + 19, "end", fmt::format("{:.3g} events / 1000 steps", row->rate));
        for (std::size_t c = 0; c < prices.size(); ++c) {
            body += cell(static_cast<int>(c), y, *row, prices[c]);
        }
        y += cell_height;
    }
    const int width = left + static_cast<int>(prices.size()) * cell_width + 10;
    std::ofstream out(file);
    out << fmt::format(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{}' height='{}' font-family='sans-serif' "
        "font-size='11'>\n<rect width='100%' height='100%' fill='white'/>\n",
        width, y + 10);
    out << text(8, 18, "start",
                "The fastest way with the events of a look at every step, and how many times "
                "faster, by the price of the guard.");
    out << body << "</svg>\n";
    out.close();
    if (!out) throw std::runtime_error("cannot write " + file);
}

}  // namespace ricochet::bench
