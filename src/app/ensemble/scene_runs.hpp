// The runs of an ensemble of scenes: a file of JSON in which the rows of a table replace numbers.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "ensemble_runs.hpp"

namespace ricochet::app {

/// A scene as the text of its file, whose numbers have names: "gravity.y",
/// "materials.steel.restitution", "bodies.ball.velocity.x", "walls.0.motion.frequency",
/// "run.t_end". Members of lists are called by their "name" or their number; x and y are the two
/// numbers of a pair. "t-start", "t-end", "rtol", "atol", "contact-step", "max-events" and "seed"
/// are those of "run", and "id" sets nothing.
class SceneText {
public:
    /// Reads the file, and sets what the request sets for all rows.
    /// @throws BadInput for a file that is no scene, or an option that scenes do not have.
    SceneText(const std::string& file, const RunRequest& request);

    [[nodiscard]] const std::string& file() const noexcept { return file_; }
    [[nodiscard]] const Json& json() const noexcept { return json_; }
    /// The columns that it has. It must outlive them.
    [[nodiscard]] ColumnSource columns() const;
    /// Sets the number of a column in a scene.
    static void set(Json& scene, const Column& column, double value);

private:
    [[nodiscard]] Column column(std::string_view where, std::string_view name) const;

    std::string file_;
    Json json_;
};

class SceneRuns final : public RowRuns {
public:
    /// @throws BadInput where the scene has no end.
    SceneRuns(const SceneText& text, Table table, std::size_t events);

    [[nodiscard]] std::string name() const override { return text_.file(); }
    [[nodiscard]] const Table& table() const override { return table_; }
    [[nodiscard]] Json setup(std::size_t shares) const override;
    void run_row(std::size_t row, std::string& out) const override;

private:
    [[nodiscard]] std::vector<Field> fields() const;
    void put_inputs(std::size_t row, RowWriter& out) const;

    SceneText text_;
    Table table_;
    std::size_t events_ = 0;
    std::vector<std::string> bodies_;  ///< names of those whose states are results
};

}  // namespace ricochet::app
