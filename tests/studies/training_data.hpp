// Training sets generated again, compared with the data in training_data/.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>

#include "ricochet/nn/model.hpp"
#include "studies/table_files.hpp"
#include "studies/training_sets.hpp"

namespace ricochet::studies {

/// A file of training_data/.
inline std::string stored(std::string_view name)
{
    std::ifstream in(std::string(RICOCHET_TRAINING_DATA "/").append(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// The line of checksums.csv that begins with this name; empty: there is none.
inline std::string stored_line(std::string_view model)
{
    std::istringstream lines(stored("checksums.csv"));
    for (std::string line; std::getline(lines, line);) {
        if (line.substr(0, line.find(',')) == model) return line;
    }
    return "";
}

inline const ModelData& data_of(std::string_view model)
{
    const std::span<const ModelData> all = model_data();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const ModelData& d) { return d.model == model; });
    if (found == all.end() || !found->make) throw std::logic_error("no set of this model");
    return *found;
}

inline bool same_elementary_functions()
{
    const TrainingSet set = elementary_functions();
    return checksum_line("elementary-functions", set, to_npy(set)) ==
           stored_line("elementary-functions");
}

/// Expects the numbers of two CSV files to be equal to 1e-9, relative to the larger of 1 and the
/// number. Where exp or sin is rounded differently, the first rows were found to differ by 2e-10 at
/// most: error control then takes other steps.
inline void expect_nearly_equal_rows(const std::string& expected, const std::string& found)
{
    std::istringstream a(expected);
    std::istringstream b(found);
    std::string row_a;
    std::string row_b;
    ASSERT_TRUE(std::getline(a, row_a) && std::getline(b, row_b));
    ASSERT_EQ(row_a, row_b);
    while (std::getline(a, row_a)) {
        ASSERT_TRUE(std::getline(b, row_b));
        std::istringstream cells_a(row_a);
        std::istringstream cells_b(row_b);
        for (std::string x, y; std::getline(cells_a, x, ',');) {
            ASSERT_TRUE(std::getline(cells_b, y, ','));
            const double number = std::strtod(x.c_str(), nullptr);
            if (std::isfinite(number)) {
                ASSERT_NEAR(number, std::strtod(y.c_str(), nullptr),
                            1e-9 * std::max(1.0, std::fabs(number)));
            } else {
                ASSERT_EQ(x, y);
            }
        }
    }
    EXPECT_FALSE(std::getline(b, row_b));
}

/// Checks rows, columns, checksum and the first 1000 rows of a set.
inline void expect_stored(std::string_view model, const TrainingSet& set)
{
    const std::string line = checksum_line(model, set, to_npy(set));
    const std::string csv = to_csv(set, 1000);
    const std::string stored_csv = stored(std::string(model) + ".csv");
    if (same_elementary_functions()) {
        EXPECT_EQ(line, stored_line(model));
        EXPECT_TRUE(csv == stored_csv) << "the rows of " << model << ".csv are others";
        return;
    }
    const std::string expected = stored_line(model);
    EXPECT_EQ(line.substr(0, line.rfind(',')), expected.substr(0, expected.rfind(',')));
    expect_nearly_equal_rows(stored_csv, csv);
}

/// Checks that the features of a gate's training part have the mean that the shipped network
/// subtracts, to `tolerance` standard deviations, and lie in its box: it was trained on these
/// states.
inline void expect_trained_on(std::string_view gate, const TrainingSet& set, double tolerance)
{
    const Model model =
        load_model(std::string(RICOCHET_MODELS "/").append(gate).append(".safetensors"));
    const std::size_t width = model.offset.size();
    ASSERT_EQ(set.columns.size(), width + 4);
    for (std::size_t k = 0; k < width; ++k) {
        double sum = 0;
        double count = 0;
        double lower = set.row(0)[k];
        double upper = lower;
        for (std::size_t i = 0; i < set.rows() && set.row(i).back() == part::training; ++i) {
            const double x = set.row(i)[k];
            sum += x;
            ++count;
            lower = std::min(lower, x);
            upper = std::max(upper, x);
        }
        // The scale is one over the standard deviation.
        EXPECT_NEAR(sum / count * model.scale[k], model.offset[k] * model.scale[k], tolerance)
            << set.columns[k].name;
        EXPECT_GE(lower, model.domain[k].lower - 1e-9);
        EXPECT_LE(upper, model.domain[k].upper + 1e-9);
    }
}

}  // namespace ricochet::studies
