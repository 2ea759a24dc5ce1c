// Parts shared by the two files on the potentials paper.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "exhibit.hpp"
#include "ricochet/learn_steps/train_friction.hpp"

namespace ricochet::app {

using Histories = std::vector<FrictionHistory>;

/// The data of the study, made once.
[[nodiscard]] const FrictionData& friction_data();

[[nodiscard]] Histories part(const Histories& from, std::size_t first, std::size_t count);

/// A training with a fixed number of iterations, so that it can be repeated bit for bit.
[[nodiscard]] learn::LearnedFriction fit(const Histories& histories, int iterations,
                                         std::uint64_t seed = 1);

/// An agreement that holds if our number lies between 0 and `upper`.
[[nodiscard]] Agreement at_most(std::string what, double ours, double paper, double upper);

[[nodiscard]] Exhibit potentials_table_1(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_table_2(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_table_3(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_table_4(const ExhibitSize& size);
[[nodiscard]] Exhibit potentials_figure_8(const ExhibitSize& size);

}  // namespace ricochet::app
