// One instance of an FMU: every call of its functions, with its errors as exceptions.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fmi/unpacked.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::fmi {

/// What event mode has ended with.
struct EventInfo {
    bool terminate = false;
    bool nominals_changed = false, states_changed = false;
    double next_time = std::numeric_limits<double>::infinity();  ///< [s] of the next time event
};

/// The end of a communication step.
struct Stepped {
    double t = 0;  ///< [s] reached
    bool event = false, terminate = false;
};

class Instance {
public:
    /// @throws Error if the library cannot be loaded, or gives no instance
    Instance(std::shared_ptr<const Unpacked> unpacked, Kind kind);
    ~Instance();
    Instance(const Instance&) = delete;
    Instance& operator=(const Instance&) = delete;

    [[nodiscard]] const Description& description() const noexcept { return unpacked_->description; }
    [[nodiscard]] const Interface& interface() const noexcept { return *interface_; }
    [[nodiscard]] std::size_t states() const noexcept { return description().state_count; }
    [[nodiscard]] std::size_t indicators() const noexcept { return description().indicator_count; }

    /// Sets one element of a variable; the others keep their values.
    void set(const Element& element, double value);
    [[nodiscard]] double get(const Element& element);

    // --- of both kinds ---

    void enter_initialization(double t_start, double t_end, double rtol);
    /// To event mode, or to step mode where there is none.
    void exit_initialization();
    void enter_event_mode();
    /// Event iteration, until no round is wanted. Flags of all rounds are joined.
    [[nodiscard]] EventInfo iterate();

    // --- model exchange ---

    void enter_continuous_time_mode();
    /// False: the FMU has discarded the point.
    [[nodiscard]] bool place(double t, std::span<const double> x);
    [[nodiscard]] bool derivatives(std::span<double> dxdt);
    [[nodiscard]] bool indicator_values(std::span<double> z);
    void read_states(std::span<double> x);
    void read_nominals(std::span<double> nominals);
    /// Column j of the Jacobian, from its derivatives. False: discarded.
    [[nodiscard]] bool directional(std::size_t j, std::span<double> column);
    /// Whether the FMU asks for event mode; sets `terminate` where it asks for the end.
    [[nodiscard]] bool completed_step(bool& terminate);

    // --- co-simulation ---

    [[nodiscard]] Stepped step(double t, double h);
    /// Keeps the present state, in place of one that was kept before.
    void keep_state();
    void go_back_to_kept_state();
    /// A state of its own, which must not outlive the instance.
    [[nodiscard]] std::shared_ptr<void> save_state();
    void restore_state(void* state);
    void enter_step_mode();
    [[nodiscard]] bool uses_event_mode() const noexcept { return event_mode_; }

    Calls calls;

private:
    enum class Stage : std::uint8_t { instantiated, initialized, failed, lost };

    void instantiate2();
    void instantiate3();
    void check(int status, std::string_view function);
    /// False where the status is that of a discarded point.
    [[nodiscard]] bool settled(int status, std::string_view function);
    [[nodiscard]] std::string logged() const;
    void remember(std::string_view message);
    template <class T, class Call>
    void read_as(Call call, const Variable& variable, std::span<double> values);
    template <class T, class Call>
    void write_as(Call call, const Variable& variable, std::span<const double> values);
    void read(const Variable& variable, std::span<double> values);
    void write(const Variable& variable, std::span<const double> values);
    [[nodiscard]] const Variable& number(const Element& element) const;
    bool update2(EventInfo& all);
    bool update3(EventInfo& all);
    void list_derivatives();

    static void log2(void* self, const char* instance, int status, const char* category,
                     const char* format, ...);
    static void log3(void* self, int status, const char* category, const char* message);

    std::shared_ptr<const Unpacked> unpacked_;
    const Interface* interface_;
    Kind kind_;
    std::optional<Library> library_;
    Functions f_{};
    Callbacks2 callbacks_{};
    std::string identifier_, resources_;
    Handle handle_ = nullptr;
    Stage stage_ = Stage::instantiated;
    bool event_mode_ = false;
    void* kept_ = nullptr;     ///< state
    bool may_return_ = false;  ///< to an earlier state
    std::vector<std::string> messages_;
    std::vector<Reference> derivative_references_;
    std::vector<Element> state_elements_;
    std::vector<double> work_;
};

}  // namespace ricochet::fmi
