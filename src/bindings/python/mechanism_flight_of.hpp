// Flights and steps in contact of one number of coordinates, for its own source of each.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "mechanism_flights.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"

namespace ricochet::python {

template <int N>
class CalledMechanism final : public detail::AnyMechanism<N> {
    using Any = detail::AnyMechanism<N>;
    using Vector = typename Any::Vector;

public:
    explicit CalledMechanism(MechanismCalls& calls)
        : Any(static_cast<int>(calls.contacts()), static_cast<int>(calls.components_of_each()),
              calls.surfaces_move()),
          calls_(&calls)
    {
    }

    [[nodiscard]] std::unique_ptr<const Any> clone() const override
    {
        return std::make_unique<CalledMechanism>(*calls_);
    }
    void mass(const Vector& q, typename Any::Square& m) const override
    {
        std::array<double, static_cast<std::size_t>(N * N)> rows;
        calls_->mass(q.data(), rows.data());
        const double* next = rows.data();
        for (int i = 0; i < N; ++i) {
            for (int j = 0; j < N; ++j) m(i, j) = *next++;
        }
    }
    void force(detail::MechanismAt at, const Vector& q, const Vector& v, Vector& f) const override
    {
        calls_->force(at.mode, at.t, q.data(), v.data(), f.data());
    }
    void acceleration(detail::MechanismAt at, const Vector& q, const Vector& v,
                      Vector& a) const override
    {
        typename Any::Square m;
        Vector f;
        mass(q, m);
        force(at, q, v, f);
        a = m.llt().solve(f);
    }
    void gaps(double t, const Vector& q, typename Any::Gaps& g) const override
    {
        g.resize(this->contacts);
        calls_->gaps(t, q.data(), g.data());
    }
    void directions(double t, const Vector& q, typename Any::Directions& h) const override
    {
        std::vector<double> rows(calls_->components() * static_cast<std::size_t>(N));
        calls_->directions(t, q.data(), rows.data());
        h.resize(static_cast<Eigen::Index>(calls_->components()), N);
        const double* next = rows.data();
        for (Eigen::Index i = 0; i < h.rows(); ++i) {
            for (int j = 0; j < N; ++j) h(i, j) = *next++;
        }
    }
    void surface_rates(double t, const Vector& q, Eigen::VectorXd& b) const override
    {
        b.resize(static_cast<Eigen::Index>(calls_->components()));
        calls_->surface_rates(t, q.data(), b.data());
    }
    [[nodiscard]] double gap(int contact, double t, const Vector& q) const override
    {
        typename Any::Gaps all;
        gaps(t, q, all);
        return all[contact];
    }
    [[nodiscard]] double gap_rate(int contact, double t, const Vector& q,
                                  const Vector& v) const override
    {
        typename Any::Directions all;
        directions(t, q, all);
        double rate = all.row(contact * this->components).dot(v);
        if (!this->moves) return rate;
        Eigen::VectorXd rates;
        surface_rates(t, q, rates);
        return rate + rates[contact * this->components];
    }
    [[nodiscard]] double restitution(int contact) const override
    {
        return calls_->restitution(static_cast<std::size_t>(contact));
    }
    [[nodiscard]] double friction(int contact) const override
    {
        return calls_->friction(static_cast<std::size_t>(contact));
    }
    [[nodiscard]] double dry_friction(int coordinate) const override
    {
        return calls_->dry_friction(static_cast<std::size_t>(coordinate));
    }

private:
    MechanismCalls* calls_;
};

template <int N>
class FlightOf final : public MechanismFlight {
    using Flight = detail::AnyFlight<N>;
    using Fixed = typename Flight::State;

public:
    explicit FlightOf(MechanismCalls& calls) : flight_(CalledMechanism<N>(calls)) {}

    [[nodiscard]] const detail::FlightKinds& kinds() const noexcept override
    {
        return flight_.kinds();
    }
    [[nodiscard]] std::vector<std::size_t> dry() const override
    {
        std::vector<std::size_t> out;
        for (std::size_t k = 0; k < kinds().dry(); ++k) {
            out.push_back(static_cast<std::size_t>(N + flight_.dry()[k].coordinate));
        }
        return out;
    }
    void accelerate(Mode mode, double t, const State& x, State& dxdt) const override
    {
        Fixed rate;
        flight_.accelerate(mode, t, fixed(x), rate);
        dxdt.assign(rate.begin(), rate.end());
    }
    [[nodiscard]] double gap(std::size_t contact, double t, const State& x) const override
    {
        return flight_.gap(contact, t, fixed(x));
    }
    [[nodiscard]] double gap_rate(std::size_t contact, double t, const State& x) const override
    {
        return flight_.gap_rate(contact, t, fixed(x));
    }
    void collide(std::span<const std::size_t> closed, double t, State& x) const override
    {
        Fixed state = fixed(x);
        flight_.collide(closed, t, state);
        x.assign(state.begin(), state.end());
    }
    [[nodiscard]] detail::Owner<detail::ContactSteps> steps() const override
    {
        return detail::Owner<detail::ContactSteps>(
            new detail::ContactStepsOf<N>(flight_.mechanism()));
    }
    void check_start(double t, const State& x) const override
    {
        const Fixed state = fixed(x);
        detail::check_start(flight_.mechanism(), t, Flight::position(state),
                            Flight::velocity(state));
    }

private:
    [[nodiscard]] static Fixed fixed(const State& x)
    {
        Fixed out;
        std::copy_n(x.begin(), out.size(), out.begin());
        return out;
    }

    Flight flight_;
};

template <int N>
std::unique_ptr<MechanismFlight> make_flight(MechanismCalls& calls)
{
    return std::make_unique<FlightOf<N>>(calls);
}

}  // namespace ricochet::python
