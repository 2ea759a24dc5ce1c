#include "fmi/instance.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <type_traits>
#include <utility>

namespace ricochet::fmi {

namespace {

constexpr int most_rounds = 1000;         // of an event iteration
constexpr std::size_t kept_messages = 5;  // of the FMU, for errors

std::string_view status_name(int status)
{
    switch (status) {
        case status_ok: return "OK";
        case status_warning: return "Warning";
        case status_discard: return "Discard";
        case status_error: return "Error";
        case status_fatal: return "Fatal";
        default: return "an unknown status";
    }
}

const Interface& interface_of(const Description& d, Kind kind)
{
    const auto& offered = kind == Kind::co_simulation ? d.co_simulation : d.model_exchange;
    if (!offered) {
        throw Error(
            fmt::format("{}: offers no {}{}", d.file,
                        kind == Kind::co_simulation ? "co-simulation" : "model exchange",
                        d.scheduled_execution ? "; scheduled execution is not supported" : ""));
    }
    for (const Variable& variable : d.variables) {
        if (variable.type != Type::clock) continue;
        throw Error(
            fmt::format("{}: has the clock '{}'; clocks are not supported", d.file, variable.name));
    }
    return *offered;
}

}  // namespace

Instance::Instance(std::shared_ptr<const Unpacked> unpacked, Kind kind)
    : unpacked_(std::move(unpacked)),
      interface_(&interface_of(description(), kind)),
      kind_(kind),
      identifier_(interface_->identifier)
{
    library_.emplace(unpacked_->binary(kind), description(), kind);
    f_ = library_->functions;
    list_derivatives();
    std::error_code ignored;
    std::filesystem::create_directories(unpacked_->folder.path() / "resources", ignored);
    description().version == 2 ? instantiate2() : instantiate3();
    if (handle_ == nullptr) {
        throw Error(fmt::format(
            "{}: gives no instance{}; a frequent reason is that the library "
            "belongs to another description, whose {} is not '{}'",
            description().file, logged(),
            description().version == 2 ? "guid" : "instantiationToken", description().token));
    }
}

Instance::~Instance()
{
    if (handle_ == nullptr || stage_ == Stage::lost) return;
    if (kept_ != nullptr) f_.free_state(handle_, &kept_);
    if (stage_ == Stage::initialized) f_.terminate(handle_);
    f_.free(handle_);
}

void Instance::list_derivatives()
{
    for (const std::size_t i : description().derivatives) {
        derivative_references_.push_back(description().variables[i].reference);
    }
    for (const std::size_t i : description().states) {
        for (std::size_t k = 0; k < description().variables[i].size; ++k) {
            state_elements_.push_back({i, k});
        }
    }
}

void Instance::instantiate2()
{
    callbacks_ = {.logger = log2,
                  .allocate = std::calloc,
                  .release = std::free,
                  .step_finished = nullptr,
                  .environment = this};
    resources_ = fmt::format("file://{}/resources", unpacked_->folder.path().string());
    handle_ = f_.instantiate2(identifier_.c_str(), kind_ == Kind::co_simulation ? 1 : 0,
                              description().token.c_str(), resources_.c_str(), &callbacks_, 0, 0);
}

void Instance::instantiate3()
{
    resources_ = fmt::format("{}/resources/", unpacked_->folder.path().string());
    const char* const name = identifier_.c_str();
    const char* const token = description().token.c_str();
    if (kind_ == Kind::model_exchange) {
        handle_ = f_.instantiate_me3(name, token, resources_.c_str(), false, false, this, log3);
        return;
    }
    event_mode_ = interface_->event_mode;
    handle_ = f_.instantiate_cs3(name, token, resources_.c_str(), false, false, event_mode_,
                                 event_mode_, nullptr, 0, this, log3, nullptr);
}

// --- messages and errors ---

void Instance::remember(std::string_view message)
{
    if (messages_.size() == kept_messages) messages_.erase(messages_.begin());
    messages_.emplace_back(message.substr(0, 500));
}

void Instance::log2(void* self, const char* /*instance*/, int status, const char* /*category*/,
                    const char* format, ...)
{
    if (status < status_discard || self == nullptr || format == nullptr) return;
    char text[500];
    std::va_list values;
    va_start(values, format);
    std::vsnprintf(text, sizeof text, format, values);
    va_end(values);
    static_cast<Instance*>(self)->remember(text);
}

void Instance::log3(void* self, int status, const char* /*category*/, const char* message)
{
    if (status < status_discard || self == nullptr || message == nullptr) return;
    static_cast<Instance*>(self)->remember(message);
}

std::string Instance::logged() const
{
    std::string text;
    for (const std::string& message : messages_) text += fmt::format("; it says: {}", message);
    return text;
}

void Instance::check(int status, std::string_view function)
{
    if (status == status_ok || status == status_warning) return;
    stage_ = status == status_fatal ? Stage::lost : Stage::failed;
    throw CallError(fmt::format("{}: {}{} returned {}{}", description().file,
                                description().version == 2 ? "fmi2" : "fmi3", function,
                                status_name(status), logged()));
}

bool Instance::settled(int status, std::string_view function)
{
    if (status == status_discard) return false;
    check(status, function);
    return true;
}

// --- values of variables ---

const Variable& Instance::number(const Element& element) const
{
    const Variable& variable = description().variables[element.variable];
    if (!is_number(variable.type)) {
        throw Error(fmt::format("{}: '{}' is not a number", description().file, variable.name));
    }
    return variable;
}

/// Room for the elements of a variable: numbers alone do without an allocation.
template <class T>
class Elements {
public:
    explicit Elements(std::size_t size)
    {
        if (size != 1) more_ = std::make_unique<T[]>(size);  // no std::vector<bool>
    }
    [[nodiscard]] T* data() noexcept { return more_ ? more_.get() : &one_; }

private:
    T one_{};
    std::unique_ptr<T[]> more_;
};

template <class T, class Call>
void Instance::read_as(Call call, const Variable& variable, std::span<double> values)
{
    Elements<T> elements(variable.size);
    T* const data = elements.data();
    int status = 0;
    if constexpr (std::is_same_v<Call, Get3<T>>) {
        status = call(handle_, &variable.reference, 1, data, variable.size);
    } else {
        status = call(handle_, &variable.reference, 1, data);
    }
    if (status > status_warning) check(status, fmt::format("Get of '{}'", variable.name));
    for (std::size_t i = 0; i < variable.size; ++i) values[i] = static_cast<double>(data[i]);
}

template <class T, class Call>
void Instance::write_as(Call call, const Variable& variable, std::span<const double> values)
{
    Elements<T> elements(variable.size);
    T* const data = elements.data();
    for (std::size_t i = 0; i < variable.size; ++i) {
        if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
            const double value = values[i];
            const double least = static_cast<double>(std::numeric_limits<T>::min());
            const double most = static_cast<double>(std::numeric_limits<T>::max());
            if (!(value >= least && value <= most && value < 0x1p63) ||
                value != std::floor(value)) {
                throw Error(
                    fmt::format("{}: '{}' was given {}; expected a whole number of its range",
                                description().file, variable.name, value));
            }
        }
        data[i] = static_cast<T>(values[i]);
    }
    int status = 0;
    if constexpr (std::is_same_v<Call, Set3<T>>) {
        status = call(handle_, &variable.reference, 1, data, variable.size);
    } else {
        status = call(handle_, &variable.reference, 1, data);
    }
    if (status > status_warning) check(status, fmt::format("Set of '{}'", variable.name));
}

void Instance::read(const Variable& v, std::span<double> values)
{
    if (description().version == 2) {
        switch (v.type) {
            case Type::float64: return read_as<double>(f_.get_real2, v, values);
            case Type::boolean: return read_as<int>(f_.get_boolean2, v, values);
            default: return read_as<int>(f_.get_integer2, v, values);
        }
    }
    switch (v.type) {
        case Type::float64: return read_as<double>(f_.get_float64, v, values);
        case Type::float32: return read_as<float>(f_.get_float32, v, values);
        case Type::int8: return read_as<std::int8_t>(f_.get_int8, v, values);
        case Type::uint8: return read_as<std::uint8_t>(f_.get_uint8, v, values);
        case Type::int16: return read_as<std::int16_t>(f_.get_int16, v, values);
        case Type::uint16: return read_as<std::uint16_t>(f_.get_uint16, v, values);
        case Type::int32: return read_as<std::int32_t>(f_.get_int32, v, values);
        case Type::uint32: return read_as<std::uint32_t>(f_.get_uint32, v, values);
        case Type::int64: return read_as<std::int64_t>(f_.get_int64, v, values);
        case Type::uint64: return read_as<std::uint64_t>(f_.get_uint64, v, values);
        default: return read_as<bool>(f_.get_boolean3, v, values);
    }
}

void Instance::write(const Variable& v, std::span<const double> values)
{
    if (description().version == 2) {
        switch (v.type) {
            case Type::float64: return write_as<double>(f_.set_real2, v, values);
            case Type::boolean: return write_as<int>(f_.set_boolean2, v, values);
            default: return write_as<int>(f_.set_integer2, v, values);
        }
    }
    switch (v.type) {
        case Type::float64: return write_as<double>(f_.set_float64, v, values);
        case Type::float32: return write_as<float>(f_.set_float32, v, values);
        case Type::int8: return write_as<std::int8_t>(f_.set_int8, v, values);
        case Type::uint8: return write_as<std::uint8_t>(f_.set_uint8, v, values);
        case Type::int16: return write_as<std::int16_t>(f_.set_int16, v, values);
        case Type::uint16: return write_as<std::uint16_t>(f_.set_uint16, v, values);
        case Type::int32: return write_as<std::int32_t>(f_.set_int32, v, values);
        case Type::uint32: return write_as<std::uint32_t>(f_.set_uint32, v, values);
        case Type::int64: return write_as<std::int64_t>(f_.set_int64, v, values);
        case Type::uint64: return write_as<std::uint64_t>(f_.set_uint64, v, values);
        default: return write_as<bool>(f_.set_boolean3, v, values);
    }
}

double Instance::get(const Element& element)
{
    const Variable& variable = number(element);
    work_.resize(variable.size);
    read(variable, work_);
    return work_[element.offset];
}

void Instance::set(const Element& element, double value)
{
    const Variable& variable = number(element);
    work_.resize(variable.size);
    if (variable.size > 1) read(variable, work_);
    work_[element.offset] = value;
    write(variable, work_);
}

// --- initialization and event mode ---

void Instance::enter_initialization(double t_start, double t_end, double rtol)
{
    if (description().version == 2) {
        check(f_.setup2(handle_, 1, rtol, t_start, 1, t_end), "SetupExperiment");
        check(f_.enter_initialization2(handle_), "EnterInitializationMode");
    } else {
        check(f_.enter_initialization3(handle_, true, rtol, t_start, true, t_end),
              "EnterInitializationMode");
    }
}

void Instance::exit_initialization()
{
    check(f_.exit_initialization(handle_), "ExitInitializationMode");
    stage_ = Stage::initialized;
    if (description().version == 2 || kind_ == Kind::co_simulation) return;
    const auto agree = [&](auto function, std::size_t expected, std::string_view what) {
        std::size_t count = 0;
        check(function(handle_, &count), fmt::format("GetNumberOf{}", what));
        if (count == expected) return;
        throw Error(fmt::format("{}: the library has {} {}, the description {}", description().file,
                                count, what, expected));
    };
    agree(f_.count_states3, states(), "ContinuousStates");
    agree(f_.count_indicators3, indicators(), "EventIndicators");
}

void Instance::enter_event_mode()
{
    ++calls.event_modes;
    check(f_.enter_event(handle_), "EnterEventMode");
}

EventInfo Instance::iterate()
{
    EventInfo all;
    for (int round = 0;; ++round) {
        if (round == most_rounds) {
            stage_ = Stage::failed;
            throw CallError(fmt::format("{}: its event iteration has not ended after {} rounds",
                                        description().file, most_rounds));
        }
        ++calls.rounds;
        const bool again = description().version == 2 ? update2(all) : update3(all);
        if (!again || all.terminate) return all;
    }
}

bool Instance::update2(EventInfo& all)
{
    EventInfo2 info{};
    check(f_.update2(handle_, &info), "NewDiscreteStates");
    all.terminate |= info.terminate != 0;
    all.nominals_changed |= info.nominals_changed != 0;
    all.states_changed |= info.values_changed != 0;
    all.next_time =
        info.next_time_defined != 0 ? info.next_time : std::numeric_limits<double>::infinity();
    return info.new_discrete_states_needed != 0;
}

bool Instance::update3(EventInfo& all)
{
    bool again = false, end = false, nominals = false, values = false, defined = false;
    double next = 0;
    check(f_.update3(handle_, &again, &end, &nominals, &values, &defined, &next),
          "UpdateDiscreteStates");
    all.terminate |= end;
    all.nominals_changed |= nominals;
    all.states_changed |= values;
    all.next_time = defined ? next : std::numeric_limits<double>::infinity();
    return again;
}

// --- model exchange ---

void Instance::enter_continuous_time_mode()
{
    check(f_.enter_continuous(handle_), "EnterContinuousTimeMode");
}

bool Instance::place(double t, std::span<const double> x)
{
    ++calls.set_time;
    if (!settled(f_.set_time(handle_, t), "SetTime")) return false;
    if (x.empty()) return true;
    ++calls.set_states;
    return settled(f_.set_states(handle_, x.data(), x.size()), "SetContinuousStates");
}

bool Instance::derivatives(std::span<double> dxdt)
{
    ++calls.derivatives;
    return settled(f_.derivatives(handle_, dxdt.data(), dxdt.size()), "GetDerivatives");
}

bool Instance::indicator_values(std::span<double> z)
{
    ++calls.indicators;
    return settled(f_.indicators(handle_, z.data(), z.size()), "GetEventIndicators");
}

void Instance::read_states(std::span<double> x)
{
    check(f_.get_states(handle_, x.data(), x.size()), "GetContinuousStates");
}

void Instance::read_nominals(std::span<double> nominals)
{
    check(f_.get_nominals(handle_, nominals.data(), nominals.size()),
          "GetNominalsOfContinuousStates");
}

bool Instance::directional(std::size_t j, std::span<double> column)
{
    ++calls.directional;
    const Variable& state = description().variables[state_elements_[j].variable];
    const std::size_t unknowns = derivative_references_.size();
    if (description().version == 2) {
        const double one = 1;
        return settled(f_.directional2(handle_, derivative_references_.data(), unknowns,
                                       &state.reference, 1, &one, column.data()),
                       "GetDirectionalDerivative");
    }
    work_.assign(state.size, 0);
    work_[state_elements_[j].offset] = 1;
    return settled(
        f_.directional3(handle_, derivative_references_.data(), unknowns, &state.reference, 1,
                        work_.data(), work_.size(), column.data(), column.size()),
        "GetDirectionalDerivative");
}

bool Instance::completed_step(bool& terminate)
{
    ++calls.completed_steps;
    if (description().version == 2) {
        int event = 0, end = 0;
        check(f_.completed2(handle_, 1, &event, &end), "CompletedIntegratorStep");
        terminate |= end != 0;
        return event != 0;
    }
    bool event = false, end = false;
    check(f_.completed3(handle_, true, &event, &end), "CompletedIntegratorStep");
    terminate |= end;
    return event;
}

// --- co-simulation ---

Stepped Instance::step(double t, double h)
{
    ++calls.steps;
    Stepped stepped{.t = t + h};
    if (description().version == 2) {
        const int status = f_.step2(handle_, t, h, may_return_ ? 0 : 1);
        if (status != status_discard) {
            check(status, "DoStep");
            return stepped;
        }
        constexpr int terminated = 3, last_successful_time = 2;  // fmi2StatusKind
        int end = 0;
        if (f_.boolean_status2 == nullptr || f_.real_status2 == nullptr ||
            f_.boolean_status2(handle_, terminated, &end) != status_ok || end == 0 ||
            f_.real_status2(handle_, last_successful_time, &stepped.t) != status_ok) {
            check(status, "DoStep");
        }
        stepped.terminate = true;
        return stepped;
    }
    bool early = false;
    check(f_.step3(handle_, t, h, !may_return_, &stepped.event, &stepped.terminate, &early,
                   &stepped.t),
          "DoStep");
    if (!early && !stepped.terminate) stepped.t = t + h;
    return stepped;
}

std::shared_ptr<void> Instance::save_state()
{
    if (f_.keep_state == nullptr) {
        throw Error(fmt::format("{}: does not offer to keep its state", description().file));
    }
    may_return_ = true;
    void* state = nullptr;
    check(f_.keep_state(handle_, &state), "GetFMUState");
    return {state, [this](void* kept) {
                if (stage_ != Stage::lost) f_.free_state(handle_, &kept);
            }};
}

void Instance::restore_state(void* state)
{
    if (stage_ == Stage::lost) throw Error(fmt::format("{}: is lost", description().file));
    check(f_.set_kept_state(handle_, state), "SetFMUState");
    stage_ = Stage::initialized;
}

void Instance::keep_state()
{
    may_return_ = true;
    check(f_.keep_state(handle_, &kept_), "GetFMUState");
}

void Instance::go_back_to_kept_state()
{
    check(f_.set_kept_state(handle_, kept_), "SetFMUState");
}

void Instance::enter_step_mode()
{
    check(f_.enter_step3(handle_), "EnterStepMode");
}

}  // namespace ricochet::fmi
