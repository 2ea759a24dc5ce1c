// What certificates of networks cost, and how much they clear.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "measure.hpp"
#include "ricochet/learn/certify.hpp"

namespace ricochet::bench {

/// The network of a scene, "cavern" for example, trained and proved here at the levels of
/// `options`, whose margin is that of the scene. `iterations` of the training; 0: the scene's.
/// @throws std::invalid_argument for a scene that there is not, std::runtime_error for a proof that
/// does not succeed.
[[nodiscard]] Model certified_network(std::string_view scene, std::size_t iterations,
                                      learn::CertifyOptions options);

/// Trains a network for each scene, or the one called `only`, unless the directory `models` holds
/// it, proves it and prints what came of it. Whether all was proved and clears 80 % of the states
/// beyond a tenth of the scene's scale. `iterations` of the training; 0: the scene's.
[[nodiscard]] bool certify_scenes(const std::string& only, const std::string& models,
                                  std::size_t iterations, const learn::CertifyOptions& options);

/// The same against the seconds allowed: 1 in two dimensions, 10 in three, 300 in four.
[[nodiscard]] Measured prove_scenes();

}  // namespace ricochet::bench
