// A run of an FMU in progress, of either kind.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fmi/inputs.hpp"
#include "fmi/instance.hpp"
#include "fmi/phase.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::fmi {

/// How far a run has come.
struct Progress {
    Run run;
    double t = 0;  ///< [s]
    bool ended = false;
    std::vector<double> x;  ///< one component of zero without states
    std::size_t next_sample = 0;
};

/// What both kinds of run share: the instance, its inputs, what is recorded.
struct Simulation::Parts : Progress {
    Parts(const Fmu& fmu, const Options& options, Kind kind);
    virtual ~Parts() = default;
    Parts(const Parts&) = delete;
    Parts& operator=(const Parts&) = delete;

    /// To the next event, or the end.
    virtual void advance() = 0;
    /// Sets a variable at the present time, and lets the FMU answer.
    virtual void answer(const Element& element, double value) = 0;
    /// A function that takes what the kind of run has of its own to what it is now.
    [[nodiscard]] virtual std::function<void()> keep() = 0;

    /// Calls `body`; an error of the FMU ends the run.
    template <class Body>
    void attempt(const Body& body)
    {
        try {
            body();
        } catch (const CallError& error) {
            run.t = t;
            end(End::call_failed, error.what());
        }
    }

    Options options;
    Instance instance;
    Inputs inputs;
    double t_start = 0, t_end = 1;  ///< [s]

    void end(End how, std::string message = {});

protected:
    void initialize();
    void record(Row::Place place);
    /// Whether a sample time lies at or before t, or before it alone.
    [[nodiscard]] bool sample_is_due(double by, bool or_at) const;
    void skip_samples(double up_to);

private:
    void resolve_times();
    void resolve_output();
    void set_start_values();

    std::vector<Element> output_;
};

/// By model exchange: phase by phase.
class Phases final : public Simulation::Parts {
public:
    Phases(const Fmu& fmu, const Options& options);

    void advance() override;
    void answer(const Element& element, double value) override;
    [[nodiscard]] std::function<void()> keep() override;

private:
    void read_states();
    void show_state();
    void read_nominals();
    void choose_method();
    /// Whether directional derivatives agree with differences here; warns where they do not.
    [[nodiscard]] bool derivatives_agree();
    void review_derivatives(std::uint64_t step);
    /// Event mode at (t, x), where the FMU stands, with everything that belongs to an event.
    /// @param set  called in event mode
    template <class Set>
    void handle(const Causes& causes, std::size_t indicator, const Set& set);
    /// The continuous motion up to `until`; what ended it.
    [[nodiscard]] Causes move(double until, std::size_t& indicator);
    template <class Stepping>
    [[nodiscard]] Causes move_by(Stepping stepping, double until, std::size_t& indicator);
    /// Records the samples of a phase from number `taken` on, up to the time `end`.
    void take_samples(const Trajectory<std::vector<double>>& samples, std::size_t& taken,
                      double end);
    [[nodiscard]] ricochet::Options options_of_phase(double until) const;
    /// Moves (t, x) along the flow until the indicator has changed its side.
    void go_to_far_side(std::size_t indicator);
    [[nodiscard]] bool is_stuck(std::size_t indicator);

    Phase phase_;
    EventInfo info_;
    std::vector<double> sides_, z_, rate_;
    std::size_t reviews_ = 0;
    bool warned_ = false;  ///< of nominal values
    // Events since the time has last advanced.
    double progress_ = 0;
    std::size_t events_without_progress_ = 0;
};

/// By co-simulation: step by step.
class Steps final : public Simulation::Parts {
public:
    Steps(const Fmu& fmu, const Options& options);

    void advance() override;
    void answer(const Element& element, double value) override;
    [[nodiscard]] std::function<void()> keep() override;

private:
    template <class Set>
    void handle(const Causes& causes, const Set& set);

    /// A watched variable.
    struct Watched {
        Element element;
        double side = 0;  ///< of the level: the last difference that was not zero
    };

    void resolve_watches();
    /// The watched variable over its level.
    [[nodiscard]] double above(std::size_t k);
    void note_sides();
    /// Whether a watched variable has passed its level, where it is over it by `to` now.
    [[nodiscard]] bool passes(std::size_t k, double to) const;
    /// Length of the step from the kept state that ends at the passage.
    [[nodiscard]] double length_to_passage(std::size_t k, double h, double at_end);
    /// Records the passages in the step from t, of which `asked` was asked, to `reached`.
    void locate_passages(double asked, double reached);

    std::vector<Watched> watches_;
    double step_ = 0;        ///< [s]
    std::size_t count_ = 0;  ///< of communication points reached
    double next_time_ = 0;   ///< [s] of the FMU's next time event
};

}  // namespace ricochet::fmi
