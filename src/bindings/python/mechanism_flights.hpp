// The flight and the steps in contact of a mechanism whose functions are called through an
// interface.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "request.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/nonsmooth/detail/contact_steps.hpp"
#include "ricochet/nonsmooth/detail/free_flight.hpp"

namespace ricochet::python {

/// The functions of a mechanism of n coordinates; see contact_motion.hpp.
class MechanismCalls {
public:
    MechanismCalls() = default;
    MechanismCalls(const MechanismCalls&) = delete;
    MechanismCalls& operator=(const MechanismCalls&) = delete;
    virtual ~MechanismCalls() = default;

    [[nodiscard]] virtual std::size_t contacts() const noexcept = 0;
    /// One normal of each contact and its tangents.
    [[nodiscard]] virtual std::size_t components_of_each() const noexcept = 0;
    [[nodiscard]] virtual bool surfaces_move() const noexcept = 0;
    [[nodiscard]] virtual double restitution(std::size_t contact) const = 0;
    [[nodiscard]] virtual double friction(std::size_t contact) const = 0;
    [[nodiscard]] virtual double dry_friction(std::size_t coordinate) const = 0;
    /// Writes n x n numbers by rows.
    virtual void mass(const double* q, double* rows) = 0;
    virtual void force(Mode mode, double t, const double* q, const double* v, double* f) = 0;
    virtual void gaps(double t, const double* q, double* g) = 0;
    /// Writes a row of n numbers for each component of each contact.
    virtual void directions(double t, const double* q, double* rows) = 0;
    virtual void surface_rates(double t, const double* q, double* b) = 0;

    /// Number of components of all contacts.
    [[nodiscard]] std::size_t components() const noexcept
    {
        return contacts() * components_of_each();
    }
};

/// The flight of a mechanism of any number of coordinates.
class MechanismFlight {
public:
    MechanismFlight() = default;
    MechanismFlight(const MechanismFlight&) = delete;
    MechanismFlight& operator=(const MechanismFlight&) = delete;
    virtual ~MechanismFlight() = default;

    [[nodiscard]] virtual const detail::FlightKinds& kinds() const noexcept = 0;
    /// Components of the state: velocities under dry friction.
    [[nodiscard]] virtual std::vector<std::size_t> dry() const = 0;
    virtual void accelerate(Mode mode, double t, const State& x, State& dxdt) const = 0;
    [[nodiscard]] virtual double gap(std::size_t contact, double t, const State& x) const = 0;
    [[nodiscard]] virtual double gap_rate(std::size_t contact, double t, const State& x) const = 0;
    virtual void collide(std::span<const std::size_t> closed, double t, State& x) const = 0;
    [[nodiscard]] virtual detail::Owner<detail::ContactSteps> steps() const = 0;
    virtual void check_start(double t, const State& x) const = 0;
};

/// @param calls  which must outlive it
template <int N>
[[nodiscard]] std::unique_ptr<MechanismFlight> make_flight(MechanismCalls& calls);

}  // namespace ricochet::python
