// A table or a figure of a paper, computed with this library: the panels, and our numbers beside
// the paper's.
//
// An exhibit is made by one function, whose only argument is its size. All numbers are computed
// when it is made, except for those that are marked as published.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "json_text.hpp"

namespace ricochet::app {

/// A curve y(x), in drawn units.
struct Curve {
    enum class Style { line, dashed, points, crosses, marked, marked_dashed };

    std::string name;
    std::vector<double> x{}, y{};
    Style style = Style::line;
    bool published = false;  ///< numbers taken from the paper
    int colour = -1;         ///< its place in the palette; negative: that of the curve
};

/// Values on a grid, row by row.
struct Tiles {
    std::vector<double> x{}, y{};
    std::vector<double> value{};  ///< y.size() rows of x.size(); NaN: none
    bool numbered = false;        ///< write the values on the tiles
    bool log_colour = false;      ///< colours follow the logarithm of the values
};

struct Panel {
    std::string title, x_label, y_label;
    std::vector<Curve> curves{};
    std::optional<Tiles> tiles{};
    bool log_x = false, log_y = false;
    bool downwards = false;  ///< y grows downwards
};

/// A row of a table.
struct ExhibitRow {
    std::string name;
    std::vector<double> value{};  ///< one per column; NaN: none
    bool published = false;
};

/// One number of ours that is held to an interval about the paper's, or below a limit.
struct Agreement {
    std::string what;
    double ours = 0;
    double paper = 0;             ///< NaN: the paper does not give it
    double lower = 0, upper = 0;  ///< interval for our number, both ends included
    [[nodiscard]] bool holds() const noexcept { return lower <= ours && ours <= upper; }
};

struct Exhibit {
    std::vector<Panel> panels{};
    std::vector<std::string> columns{};
    std::string_view format = "{:.4g}";  ///< of the values in the rows
    std::vector<ExhibitRow> rows{};
    std::vector<Agreement> agreements{};
    std::string remark{};  ///< sentences on where our numbers differ in meaning from the paper's
};

/// How much is computed.
struct ExhibitSize {
    bool full = false;  ///< the paper's meshes and trainings, which take minutes
};

enum class ExhibitKind { table, figure };
[[nodiscard]] std::string_view name(ExhibitKind kind) noexcept;

/// Entry for a table or a figure of a paper.
struct ExhibitEntry {
    ExhibitKind kind = ExhibitKind::figure;
    int number = 0;
    std::string_view title;                         ///< what the paper's exhibit shows
    Exhibit (*make)(const ExhibitSize& size) = {};  ///< null if it is not reproduced
    std::string_view why_none{};                    ///< the reason for that, as a clause
};

struct Paper {
    std::string_view name;    ///< name on the command line
    std::string_view source;  ///< authors, title
    std::vector<ExhibitEntry> exhibits;
};

/// Thrown between two runs of an exhibit after an interrupt.
struct ExhibitInterrupted {};
/// @throws ExhibitInterrupted after an interrupt.
void check_exhibit();

/// `count` numbers from first to last, evenly, or by equal factors.
[[nodiscard]] std::vector<double> even(double first, double last, std::size_t count);
[[nodiscard]] std::vector<double> geometric(double first, double last, std::size_t count);

[[nodiscard]] std::string to_text(const Exhibit& exhibit);
[[nodiscard]] Json to_json(const Exhibit& exhibit);

/// Draws the panels, as `draw` of plot.hpp.
/// @throws WriteError
void draw(const Exhibit& exhibit, const std::string& title, const std::filesystem::path& file);

}  // namespace ricochet::app
