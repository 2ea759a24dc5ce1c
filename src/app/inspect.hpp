// `ricochet inspect`: what a model file is.
#pragma once

#include <string>

namespace ricochet::app {

struct InspectRequest {
    std::string model{};  ///< path, or name in one of the model directories
    bool json = false;
};

/// Prints what the model was made for, its shape, its self-test and what an
/// inference costs here and now.
/// @return 0
/// @throws BadInput or ModelError if there is no such file or it is not a model.
int inspect(const InspectRequest& request);

}  // namespace ricochet::app
