// Parts that the two files of the paper on potentials share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "exhibit.hpp"
#include "ricochet/learn/train_friction.hpp"

namespace ricochet::app {

using Histories = std::vector<FrictionHistory>;

/// The data of the study, made once.
[[nodiscard]] const FrictionData& friction_data();

[[nodiscard]] Histories part(const Histories& from, std::size_t first, std::size_t count);

/// A training that ends after so many iterations, so that it is repeated to the bit.
[[nodiscard]] learn::LearnedFriction fit(const Histories& histories, int iterations,
                                         std::uint64_t seed = 1);

/// Ours between 0 and `upper`.
[[nodiscard]] Agreement at_most(std::string what, double ours, double paper, double upper);

[[nodiscard]] Exhibit potentials_table_1(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_table_2(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_table_3(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_table_4(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_figure_8(const ExhibitSize& size);

}  // namespace ricochet::app
