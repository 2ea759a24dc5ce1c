// Whole runs of compiled functions and formulas by the loop for up to four components, which keeps
// its states in registers and on the stack. Their bits are those of the loop for vectors.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "callbacks.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/taylor/lanes.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::python {

/// A system all of whose functions have addresses, for one run.
class SmallSystem {
    using Table = detail::SystemTable<detail::SmallState>;
    using Adapter = detail::SystemAdapter<SmallSystem, detail::SmallState>;

public:
    static constexpr bool unchecked_names = true;
    using State = detail::SmallState;

    /// @param series  of a run by Taylor's method
    SmallSystem(const CallbackSource& source, std::size_t components, const double* parameters,
                const FormulaSeries* series, SignalWatch& watch)
        : name(source.name_.empty() ? "Python" : source.name_),
          source_(&source),
          components_(components),
          parameters_(parameters),
          series_(series),
          watch_(&watch)
    {
    }

    std::string name;

    [[nodiscard]] SignalWatch& watch() const noexcept { return *watch_; }
    [[nodiscard]] const FormulaSeries& series() const noexcept { return *series_; }
    [[nodiscard]] std::size_t mode_count() const noexcept { return source_->mode_count_; }
    [[nodiscard]] std::size_t guard_count() const noexcept { return source_->guards_.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return guard(which).info; }

    template <class Xs>
    void flow(Mode mode, double t, const Xs& x, Xs& dxdt) const
    {
        watch_->tick();
        source_->flow_.flow(mode, t, x.data(), dxdt.data(), components_, parameters_);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        watch_->tick();
        // One that is not examined in this mode may have no value there.
        if (!enabled(which, mode)) return 1;
        const CallbackGuard& of = guard(which);
        const double g = of.value.value(mode, t, x.data(), components_, parameters_);
        return g == 0 && of.info.boolean ? -1 : g;
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        const auto& in_mode = guard(which).in_mode;
        return in_mode.empty() || (mode < in_mode.size() && in_mode[mode]);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& x) const
    {
        return edit(guard(which).reset, mode, t, x);
    }
    [[nodiscard]] Mode rest(std::size_t which, Mode mode, double t, State& x) const
    {
        return edit(guard(which).rest, mode, t, x);
    }

    /// What it has, as an adapter's table.
    [[nodiscard]] Table table() const
    {
        Table table = detail::system_table<SmallSystem, State>;
        const auto& guards = source_->guards_;
        const auto none = [&](const auto& has) { return std::ranges::none_of(guards, has); };
        table.guarded = !guards.empty();
        table.moded = source_->moded_;
        if (none([](const CallbackGuard& guard) { return !guard.in_mode.empty(); })) {
            table.enabled_in = nullptr;
        }
        if (none([](const CallbackGuard& guard) { return bool(guard.reset); })) {
            table.reset = nullptr;
        }
        if (none([](const CallbackGuard& guard) { return bool(guard.rest); })) {
            table.rest = nullptr;
        }
        add_times(table);
        if (std::ranges::all_of(guards, &CallbackGuard::is_rated)) add_rates(table);
        return table;
    }

private:
    [[nodiscard]] const CallbackGuard& guard(std::size_t which) const
    {
        return source_->guards_[which];
    }
    [[nodiscard]] static const SmallSystem& at(void* adapter) noexcept
    {
        return static_cast<Adapter*>(adapter)->system();
    }
    [[nodiscard]] Mode edit(const Function& function, Mode mode, double t, State& x) const
    {
        if (!function) return mode;
        const Mode next = function.edit(mode, t, x.data(), components_, parameters_);
        return source_->moded_ ? next : mode;
    }
    /// The rate of a formula with respect to the time itself.
    [[nodiscard]] double derived(std::size_t which, Mode mode, double t, const State& x,
                                 const State& dxdt) const
    {
        if (!enabled(which, mode)) return 0;
        return guard(which).derived->value_along(mode, t, x.data(), dxdt.data(), parameters_);
    }
    [[nodiscard]] static double rate(void* adapter, GuardInMode of, detail::ScaledTime time,
                                     const State& x, const State& dxdt)
    {
        const SmallSystem& system = at(adapter);
        const double known = of.backward ? -system.derived(of.which, of.mode, time.t, x,
                                                           detail::negated(State(dxdt)))
                                         : system.derived(of.which, of.mode, time.t, x, dxdt);
        if (std::isfinite(known)) return known;
        return detail::system_table<SmallSystem, State>.rate(adapter, of, time, x, dxdt);
    }
    static void add_rates(Table& table)
    {
        table.rated = true;
        table.calls_of_rate = 0;
        table.rate = &rate;
        table.point = [](void* adapter, GuardInMode of, detail::ScaledTime time, const State& x,
                         const State& dxdt) -> detail::GuardPoint {
            return {at(adapter).guard(of.which, of.mode, time.t, x),
                    rate(adapter, of, time, x, dxdt)};
        };
        table.each_rate = [](void* adapter, const detail::Along<State>& motion,
                             std::span<double> rates) {
            for (std::size_t i = 0; i < rates.size(); ++i) {
                rates[i] = at(adapter).derived(i, motion.mode, motion.t, motion.x, motion.s);
            }
        };
    }
    void add_times(Table& table) const
    {
        if (source_->times_) {
            table.next_time_event = [](void* adapter, double t) {
                return at(adapter).source_->times_->next(t);
            };
            table.previous_time_event = [](void* adapter, double t) {
                return at(adapter).source_->times_->previous(t);
            };
            table.time_event_count = [](void* adapter, double t) {
                return at(adapter).source_->times_->count(t);
            };
        }
        if (source_->time_reset_) {
            table.time_reset = [](void* adapter, Mode mode, double t, State& x) {
                return at(adapter).edit(at(adapter).source_->time_reset_, mode, t, x);
            };
        }
    }

    const CallbackSource* source_;
    std::size_t components_;
    const double* parameters_;
    const FormulaSeries* series_;
    SignalWatch* watch_;
};

}  // namespace ricochet::python

namespace ricochet::detail {

/// The series of a system whose guards are counted at run time, of n components.
template <std::size_t n>
struct TaylorAdapter<python::SmallSystem, SmallState, n>
    : SystemAdapter<python::SmallSystem, SmallState> {
    struct Step : TaylorStepOrigin {
        alignas(16) std::array<double, (most_taylor_order + 1) * n> coefficients{};
        std::vector<double> guards{};
        std::array<double, n> x{};
        std::size_t count = 0;

        [[nodiscard]] static constexpr std::size_t size() noexcept { return n; }
        [[nodiscard]] std::size_t guard_count() const noexcept { return count; }
    };
    struct Room {
        using Array = std::array<double, n>;
        using Guarded = SmallState;
        Array w, rate;
        Guarded x, there;
    };
    static constexpr bool on_series = true;

    TaylorAdapter(const python::SmallSystem& system, const SmallState& like)
        : SystemAdapter<python::SmallSystem, SmallState>(system, like)
    {
        step.count = system.guard_count();
        step.guards.resize((most_taylor_order + 1) * step.count);
        // Errors are reported before the first step.
        for (Mode mode = 0; mode < system.series().modes(); ++mode) {
            if (!system.series().code(mode)) static_cast<void>(recorded(mode));
        }
    }

    void prepare_order(int /*order*/) {}

    int compute(Mode mode, double t, const double* x, const TaylorCoefficients<double>& to)
    {
        const python::SmallSystem& system = this->system();
        system.watch().tick();
        if (const auto code = system.series().code(mode)) {
            return code(t, x, to.order, to.x, to.guards);
        }
        LazyTape& tape = recorded(mode);
        system.series().count(mode, tape);
        return tape.compute(t, x, to);
    }
    [[nodiscard]] bool is_polynomial(Mode mode)
    {
        const python::FormulaSeries& series = this->system().series();
        return series.code(mode) ? series.is_polynomial(mode) : recorded(mode).is_polynomial();
    }

    int given_order = 0;
    Step step;

private:
    [[nodiscard]] LazyTape& recorded(Mode mode)
    {
        const Mode at = mode < this->system().series().modes() ? mode : 0;
        const auto found = recorded_.find(at);
        if (found != recorded_.end()) return found->second;
        const python::SmallSystem& system = this->system();
        return recorded_.emplace(at, system.series().tape(at, system.name)).first->second;
    }

    std::map<Mode, LazyTape> recorded_;
};

}  // namespace ricochet::detail

namespace ricochet::python {

namespace {

using detail::SmallState;

[[nodiscard]] SmallState small_state(const State& x)
{
    SmallState out(x.size());
    std::ranges::copy(x, out.data());
    return out;
}

/// All parts of a run but its steps.
class SmallRun {
public:
    SmallRun(const SmallSystem& system, const State& x0, const Request& request)
        : table_(system.table()), start_(small_state(x0)), options_(request.options)
    {
        setup_.system = &table_;
        setup_.cancels_by_itself = true;
        setup_.detector =
            detail::DetectorTableOf<Extremum, SmallSystem, SmallState>::make(detector_);
        setup_.detecting = &detector_;
        setup_.locator = detail::locator_table<Newton>();
        setup_.locating = &locator_;
    }

    [[nodiscard]] Record by_name(const SmallSystem& system, MethodName method)
    {
        detail::SystemAdapter<SmallSystem, SmallState> adapter(system, start_);
        setup_.adapter = &adapter;
        setup_.kernel = &detail::kernel_by_name<SmallState>(method, start_.size());
        setup_.method_by_name = true;
        setup_.stepping = detail::written_type<ErrorControlled<MethodByName>>();
        return record_of(detail::run_whole(setup_, start_, options_));
    }

    /// The parts of a run by Taylor's method.
    template <std::size_t n>
    [[nodiscard]] const detail::RunBindings<SmallState>& parts_of_series(
        detail::StepperAdapter<SmallSystem, SmallState, detail::TaylorOf<n>>& adapter)
    {
        setup_.adapter = static_cast<detail::SystemAdapter<SmallSystem, SmallState>*>(&adapter);
        setup_.stepping = detail::written_type<ErrorControlled<Taylor>>();
        detail::step_by_series<SmallSystem, SmallState, n>(setup_);
        return setup_;
    }

    template <std::size_t n>
    [[nodiscard]] Record by_series(const SmallSystem& system)
    {
        detail::StepperAdapter<SmallSystem, SmallState, detail::TaylorOf<n>> adapter(system,
                                                                                     start_);
        return record_of(detail::run_whole(parts_of_series(adapter), start_, options_));
    }

    [[nodiscard]] const SmallState& start() const noexcept { return start_; }

private:
    detail::SystemTable<SmallState> table_;
    SmallState start_;
    const Options& options_;
    Extremum detector_;
    Newton locator_;
    detail::RunBindings<SmallState> setup_;
};

}  // namespace

std::optional<Record> CallbackSource::run_whole(const State& x0, const Request& request,
                                                SignalWatch& watch) const
{
    const std::size_t n = x0.size();
    const bool fits = small_ && n > 0 && n <= SmallState::room && request.is_plain_or_series();
    if (!fits || (request.by_series && !series_)) return std::nullopt;
    require_size(x0, request.parameters);
    const std::shared_ptr<const FormulaSeries> series =
        request.by_series ? series_for(request) : nullptr;
    const SmallSystem system(*this, n, request.parameters, series.get(), watch);
    SmallRun run(system, x0, request);
    if (!request.by_series) return run.by_name(system, request.method);
    switch (n) {
        case 1: return run.by_series<1>(system);
        case 2: return run.by_series<2>(system);
        case 3: return run.by_series<3>(system);
        default: return run.by_series<4>(system);
    }
}

namespace {

/// A run by Taylor's method whose steps are taken together with those of others.
template <std::size_t n>
class LaneParts {
public:
    LaneParts(const CallbackSource& source, const Request& request, const FormulaSeries& series,
              const State& x0)
        : system_(source, n, nullptr, &series, watch_),
          run_(system_, x0, request),
          adapter_(system_, run_.start()),
          setup_(run_.parts_of_series(adapter_))
    {
    }

    [[nodiscard]] const detail::RunBindings<SmallState>& setup() const noexcept { return setup_; }
    [[nodiscard]] auto& adapter() noexcept { return adapter_; }

private:
    SignalWatch watch_;
    SmallSystem system_;
    SmallRun run_;
    detail::StepperAdapter<SmallSystem, SmallState, detail::TaylorOf<n>> adapter_;
    const detail::RunBindings<SmallState>& setup_;
};

/// The rows of an ensemble, for `detail::LaneRuns`.
template <std::size_t n>
class LaneRows {
public:
    using Parts = LaneParts<n>;
    using Start = SmallState;

    LaneRows(const CallbackSource& source, const Request& request, const FormulaSeries& series,
             const Source::Rows& rows)
        : source_(source), request_(request), series_(series), rows_(rows)
    {
    }

    [[nodiscard]] std::size_t count() const { return rows_.count; }
    void open(std::optional<Parts>& parts, std::size_t row) const
    {
        parts.emplace(source_, request_, series_, rows_.start(rows_.first + row));
    }
    [[nodiscard]] Start start(std::size_t row) const
    {
        return small_state(rows_.start(rows_.first + row));
    }
    template <class Adapter>
    [[nodiscard]] static bool shares(const Adapter& /*adapter*/)
    {
        return true;
    }
    template <class Function>
    void attempt(std::size_t row, const Function& run) const
    {
        try {
            run();
        } catch (...) {
            rows_.fail(rows_.first + row, std::current_exception());
        }
    }
    void keep(std::size_t row, Run<Start>&& run) const
    {
        rows_.keep(rows_.first + row, record_of(std::move(run)));
    }

private:
    const CallbackSource& source_;
    const Request& request_;
    const FormulaSeries& series_;
    const Source::Rows& rows_;
};

/// The series of four runs, by code.
template <std::size_t n, bool has_guard>
class CodeLanes {
    using Pack = detail::LanePack<true>;

public:
    static constexpr std::size_t components = n;
    static constexpr bool guarded = has_guard;

    explicit CodeLanes(LanesCode code) noexcept : code_(code) {}

    template <class Adapter>
    void set(std::size_t /*lane*/, const Adapter& /*adapter*/)
    {
    }
    [[gnu::always_inline]] void compute(const Pack& t, const Pack* x,
                                        const detail::TaylorCoefficients<Pack>& to) const
    {
        const auto numbers = [](auto* packs) { return reinterpret_cast<double*>(packs); };
        code_(reinterpret_cast<const double*>(&t), reinterpret_cast<const double*>(x), to.order,
              numbers(to.x), numbers(to.guards));
    }

private:
    LanesCode code_;
};

template <std::size_t n, bool has_guard>
void run_in_lanes(LaneRows<n>& rows, const Options& options, LanesCode code)
{
    using Series = CodeLanes<n, has_guard>;
    detail::TaylorLanes<SmallSystem, SmallState, true, Series> lanes(
        options, detail::taylor_order(0, options.rtol), Series(code));
    detail::LaneRuns(lanes, rows, options).run();
}

}  // namespace

bool CallbackSource::runs_side_by_side(const Request& request, std::size_t n) const
{
    const bool fits = small_ && n > 0 && n <= SmallState::room && request.by_series &&
                      request.is_plain_or_series() && series_ && parameter_count_ == 0;
    if (!fits || moded_ || guards_.size() > 1 || n != flow_.formula->in(0).components()) {
        return false;
    }
    const detail::LazyTape& tape = series_->tape(0, name_);
    return !tape.is_polynomial() && series_->lanes(name_) && !detail::fuses_products();
}

void CallbackSource::run_side_by_side(const Request& request, const Rows& rows) const
{
    const auto run = [&]<std::size_t n>(std::integral_constant<std::size_t, n>) {
        LaneRows<n> of(*this, request, *series_, rows);
        const LanesCode code = series_->lanes(name_);
        if (guards_.empty()) {
            run_in_lanes<n, false>(of, request.options, code);
        } else {
            run_in_lanes<n, true>(of, request.options, code);
        }
    };
    switch (flow_.formula->in(0).components()) {
        case 1: return run(std::integral_constant<std::size_t, 1>());
        case 2: return run(std::integral_constant<std::size_t, 2>());
        case 3: return run(std::integral_constant<std::size_t, 3>());
        default: return run(std::integral_constant<std::size_t, 4>());
    }
}

}  // namespace ricochet::python
