// `ricochet inspect`: the contents of a model file.
#pragma once

#include <string>

namespace ricochet::app {

struct InspectRequest {
    std::string model{};  ///< path, or name in one of the model directories
    bool json = false;
};

/// Prints the purpose of the model, its shape, its self-test and the cost of an
/// inference on this machine.
/// @return 0
/// @throws BadInput or ModelError if there is no such file or it is not a model.
int inspect(const InspectRequest& request);

}  // namespace ricochet::app
