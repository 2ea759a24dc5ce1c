// Mechanisms with contacts whose functions are written in Python, as the source of runs.
#pragma once

#include "python_error.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "callbacks.hpp"
#include "source.hpp"

namespace ricochet::python {

/// Most coordinates of a mechanism: steps in contact are compiled for each number of them.
inline constexpr std::size_t most_coordinates = 6;

/// What a mechanism declares, see contact_motion.hpp.
struct MechanismDescription {
    /// @throws PythonError for entries of another type
    explicit MechanismDescription(PyObject* specification);

    Function mass, force, gaps, directions, surface_rates;
    std::vector<double> constant_mass;  ///< by rows, in place of the function
    std::vector<double> restitution, friction;
    std::vector<double> dry_friction;  ///< of each coordinate, or empty
    Ref modes;                         ///< a list, where `force` takes a mode
    std::size_t contacts = 0;
    std::size_t tangents = 1;
    bool timed_gaps = false, timed_directions = false;  ///< whether they take the time
};

class MechanismSource final : public Source {
public:
    /// @param beside  the guards, resets, time events and modes; its flow is not called
    MechanismSource(std::shared_ptr<const Source> beside, PyObject* specification);

    /// @throws std::invalid_argument for a state that is not (q, v), or of too many coordinates
    [[nodiscard]] std::unique_ptr<RunAdapter> open(const State& x0) const override;
    [[nodiscard]] std::vector<std::string> mode_names() const override { return {}; }
    /// Contacts first.
    [[nodiscard]] std::vector<std::string> guard_names() const override;

private:
    std::shared_ptr<const Source> beside_;
    MechanismDescription description_;
};

}  // namespace ricochet::python
