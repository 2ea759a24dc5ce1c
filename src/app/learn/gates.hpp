// Gates of the systems on the command line, and the runs on which they are trained.
#pragma once

#include <string_view>
#include <vector>

#include "registry.hpp"
#include "ricochet/learn/classifier.hpp"
#include "train.hpp"

namespace ricochet::app {

/// The kinds of gates that can be trained for a system: "gate", for fixed steps, and
/// "gate-adaptive", for error control. Empty: none.
[[nodiscard]] std::vector<std::string_view> gate_kinds(std::string_view system);

/// Trains a horizon gate. With defaults it is one of the models of the library.
/// @throws BadInput for options that this training does not have; as `learn::train_gate`.
[[nodiscard]] learn::TrainedGate train_system_gate(const SystemEntry& system,
                                                   const TrainingRequest& request,
                                                   const learn::ProgressCallback& progress);

}  // namespace ricochet::app
