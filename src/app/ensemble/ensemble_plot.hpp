// The results of an ensemble over a column of its table, drawn by gnuplot.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "results.hpp"
#include "rows.hpp"

namespace ricochet::app {

/// Places among the fields of a row of what a picture shows.
struct EnsemblePicture {
    std::size_t across = 0;                          ///< the first column, or the number of the row
    std::size_t colour = 0;                          ///< the second column; 0: there is none
    std::vector<std::vector<std::size_t>> panels{};  ///< results, those of one panel together
};

/// What to show of rows with these fields, the first of which are the number and `columns` columns.
/// @param show  names of results, one for each panel; if there are none, the times of events where
///              they are results, in one panel, else the final state, of which four components
/// @throws BadInput for a name that is no result, naming the nearest one, or more than 8 of them
[[nodiscard]] EnsemblePicture ensemble_picture(const std::vector<Field>& fields,
                                               std::size_t columns,
                                               const std::vector<std::string>& show);

/// Draws a point for each row. Results that are not finite, as those of rows that have failed, are
/// left out.
/// @throws WriteError as `plot` does
void plot_ensemble(const EnsemblePicture& picture, const std::vector<Field>& fields,
                   const std::string& title, const AllBlocks& blocks,
                   const std::filesystem::path& file);

}  // namespace ricochet::app
