// The data sets that the models in models/ were trained on, made again.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/data_set.hpp"

namespace ricochet::studies {

/// A table of numbers. Where a set has several parts, its last column tells them apart.
struct TrainingSet {
    std::vector<learn::Column> columns{};
    std::vector<double> values{};  ///< row by row

    [[nodiscard]] std::size_t rows() const noexcept
    {
        return columns.empty() ? 0 : values.size() / columns.size();
    }
    [[nodiscard]] std::span<const double> row(std::size_t i) const noexcept
    {
        return {values.data() + i * columns.size(), columns.size()};
    }
};

/// Value of the column "part".
namespace part {
inline constexpr double training = 0;
inline constexpr double validation = 1;
inline constexpr double test = 2;
}  // namespace part

/// Origin of the data of a model.
struct ModelData {
    std::string_view model;  ///< name of its file, without the extension
    /// Function that makes the set, or the reason why there is none.
    std::string_view origin;
    /// Makes the set, the same in every call; null where there is none.
    /// @param progress  called during runs that take seconds; its result is ignored
    TrainingSet (*make)(const learn::ProgressCallback& progress);
};

/// All models that come with the library, in the order of their names.
[[nodiscard]] std::span<const ModelData> model_data() noexcept;

/// Values of exp, log, sin, cos and pow of the C library on a grid. Their last bits differ from
/// one library or processor to another, and those of the sets with them.
[[nodiscard]] TrainingSet elementary_functions();

}  // namespace ricochet::studies
