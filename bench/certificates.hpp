// Cost of certificates of networks, and the fraction of states that they clear.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "ricochet/learn/certify.hpp"

namespace ricochet::bench {

/// The network of a scene, "cavern" for example, trained and proved here at the levels of
/// `options`, whose margin is that of the scene. `iterations` of the training; 0: the default of
/// the scene.
/// @throws std::invalid_argument for an unknown scene, std::runtime_error if the proof fails.
[[nodiscard]] Model certified_network(std::string_view scene, std::size_t iterations,
                                      learn::CertifyOptions options);

/// Trains a network for each scene, or for the one called `only`, unless the directory `models` has
/// it; proves it and prints the results. Returns whether everything was proved within the seconds
/// allowed (1 in two dimensions, 10 in three, 300 in four) and within a factor of two of the
/// estimated boxes, and clears 80 % of the states beyond a tenth of the scene's scale. `iterations`
/// of the training; 0: the default of the scene.
[[nodiscard]] bool certify_scenes(const std::string& only, const std::string& models,
                                  std::size_t iterations, const learn::CertifyOptions& options);

}  // namespace ricochet::bench
