#include "machine_code.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "assembler.hpp"
#include "ricochet/taylor/detail/taylor_sums.hpp"

#if defined(__x86_64__) && (defined(__unix__) || defined(__APPLE__))
#define RICOCHET_WITH_CODE 1
#include <sys/mman.h>
#else
#define RICOCHET_WITH_CODE 0
#endif

namespace ricochet::python {

#if RICOCHET_WITH_CODE

MachineCode::MachineCode(std::span<const unsigned char> bytes) noexcept
{
    void* const memory =
        mmap(nullptr, bytes.size(), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) return;
    std::memcpy(memory, bytes.data(), bytes.size());
    if (mprotect(memory, bytes.size(), PROT_READ | PROT_EXEC) != 0) {
        munmap(memory, bytes.size());
        return;
    }
    start_ = memory;
    size_ = bytes.size();
}

MachineCode::~MachineCode()
{
    if (start_) munmap(start_, size_);
}

bool may_make_code() noexcept
{
    static const bool may = [] {
        const char* const wanted = std::getenv("RICOCHET_CODE");
        return !(wanted && std::string_view(wanted) == "0") && __builtin_cpu_supports("avx");
    }();
    return may;
}

namespace {

using detail::LazyTape;
using detail::TapeOp;
using detail::TaylorOp;

using OfOne = double (*)(double);
using OfTwo = double (*)(double, double);

/// The function that `apply` calls for an operation; null where it calls none.
[[nodiscard]] OfOne function_of_one(FormulaCode code) noexcept
{
    switch (code) {
        case FormulaCode::cbrt: return std::cbrt;
        case FormulaCode::exp: return std::exp;
        case FormulaCode::log: return std::log;
        case FormulaCode::sin: return std::sin;
        case FormulaCode::cos: return std::cos;
        case FormulaCode::tan: return std::tan;
        case FormulaCode::asin: return std::asin;
        case FormulaCode::acos: return std::acos;
        case FormulaCode::atan: return std::atan;
        case FormulaCode::sinh: return std::sinh;
        case FormulaCode::cosh: return std::cosh;
        case FormulaCode::tanh: return std::tanh;
        default: return nullptr;
    }
}
[[nodiscard]] OfTwo function_of_two(FormulaCode code) noexcept
{
    switch (code) {
        case FormulaCode::power: return std::pow;
        case FormulaCode::atan2: return std::atan2;
        case FormulaCode::hypot: return std::hypot;
        default: return nullptr;
    }
}
/// The same for the value of an operation of a tape.
[[nodiscard]] OfOne function_of_one(TaylorOp op) noexcept
{
    switch (op) {
        case TaylorOp::cube_root: return std::cbrt;
        case TaylorOp::exponential: return std::exp;
        case TaylorOp::logarithm: return std::log;
        case TaylorOp::sine: return std::sin;
        case TaylorOp::cosine: return std::cos;
        case TaylorOp::hyperbolic_sine: return std::sinh;
        case TaylorOp::hyperbolic_cosine: return std::cosh;
        case TaylorOp::tangent: return std::tan;
        case TaylorOp::hyperbolic_tangent: return std::tanh;
        case TaylorOp::arc_sine: return std::asin;
        case TaylorOp::arc_cosine: return std::acos;
        case TaylorOp::arc_tangent: return std::atan;
        default: return nullptr;
    }
}

constexpr Xmm xmm0{0}, xmm1{1};

/// A function, with its constants behind it.
class Emitter : protected Assembler {
public:
    /// The function, or nothing.
    [[nodiscard]] MachineCode finish()
    {
        pad_to(static_cast<std::size_t>(each_));
        come_here(constants_at_);
        for (const double value : constants_) {
            for (int lane = 0; lane < each_; lane += 8) put_number(value);
        }
        return MachineCode(bytes());
    }

protected:
    /// @param pool  the register with the address of the constants
    Emitter(std::span<std::uint8_t> buffer, General pool, int lanes = 1)
        : Assembler(buffer, lanes), pool_(pool), each_(8 * lanes)
    {
        forget();
    }

    /// Bytes of a value.
    [[nodiscard]] int each() const noexcept { return each_; }

    /// A value that has a place in memory: number `of`, coefficient k.
    struct Value {
        int of, k;
        friend bool operator==(const Value&, const Value&) = default;
    };

    void find_constants() { constants_at_ = address_to_come(pool_); }
    [[nodiscard]] Place constant(double value)
    {
        const auto bits = std::bit_cast<std::uint64_t>(value);
        const auto same = [&](double other) { return std::bit_cast<std::uint64_t>(other) == bits; };
        const auto found = std::ranges::find_if(constants_, same);
        const auto number = static_cast<std::int32_t>(found - constants_.begin());
        if (found == constants_.end()) constants_.push_back(value);
        return {pool_, each_ * number};
    }

    // The newest results are in registers 2 to 15, one after the other.

    using Held = std::array<Value, 16>;
    [[nodiscard]] const Held& held() const noexcept { return held_; }
    /// Registers hold what they held elsewhere.
    void hold_again(const Held& held) { held_ = held; }
    void forget() { held_.fill({-1, -1}); }
    /// The register that holds a value, if one does.
    [[nodiscard]] std::optional<Xmm> holder(const Value& value) const
    {
        for (int r = first_held; r < 16; ++r) {
            if (held_[static_cast<std::size_t>(r)] == value) return Xmm{r};
        }
        return std::nullopt;
    }
    /// The register of the next result.
    [[nodiscard]] Xmm take()
    {
        newest_ = newest_ < 15 ? newest_ + 1 : first_held;
        hold({-1, -1});
        return {newest_};
    }
    /// The register taken last holds a value.
    void hold(const Value& value) { held_[static_cast<std::size_t>(newest_)] = value; }

    template <class F>
    void call_function(F* function)
    {
        forget();
        move(General::rax, reinterpret_cast<std::uint64_t>(function));
        call(General::rax);
    }
    void negate(Xmm to, Xmm of)
    {
        load(xmm1, constant(-0.0));
        exclusive_or(to, of, xmm1);
    }

private:
    static constexpr int first_held = 2;

    General pool_;
    int each_;
    std::size_t constants_at_ = 0;
    std::vector<double> constants_;
    Held held_{};
    int newest_ = first_held;
};

// --- values ---

class ValuesEmitter : public Emitter {
public:
    ValuesEmitter(std::span<std::uint8_t> buffer, std::span<const FormulaOp> ops)
        : Emitter(buffer, have_calls(ops) ? General::rbx : General::rax),
          ops_(ops),
          calls_(have_calls(ops))
    {
    }

    void emit(std::span<const std::size_t> outputs)
    {
        // Of calls the stack is a multiple of 16.
        const auto size = static_cast<std::int32_t>((ops_.size() * 8 + 8 + 15) / 16 * 16) + 8;
        if (calls_) {
            for (const General each : saved) push(each);
            move(General::r12, General::rdi);
            move(General::r13, General::rdx);
            move(General::r14, General::rsi);
        }
        take_from_stack(size);
        find_constants();
        store(time(), xmm0);
        for (std::size_t i = 0; i < ops_.size(); ++i) compute(i);
        for (std::size_t i = 0; i < outputs.size(); ++i) {
            const Xmm result = loaded(outputs[i]);
            store({calls_ ? General::r13 : General::rdx, bytes_of(i)}, result);
        }
        add_to_stack(size);
        if (calls_) {
            for (std::size_t i = saved.size(); i-- > 0;) pop(saved[i]);
        }
        leave();
    }

private:
    /// Registers that functions preserve.
    static constexpr std::array saved{General::rbx, General::r12, General::r13, General::r14};

    [[nodiscard]] static bool have_calls(std::span<const FormulaOp> ops) noexcept
    {
        return std::ranges::any_of(ops, [](const FormulaOp& op) {
            return function_of_one(op.code) || function_of_two(op.code);
        });
    }
    [[nodiscard]] static std::int32_t bytes_of(std::size_t doubles) noexcept
    {
        return static_cast<std::int32_t>(8 * doubles);
    }
    [[nodiscard]] static Value value(std::size_t i) { return {static_cast<int>(i), 0}; }
    /// Where the result of an operation is in memory.
    [[nodiscard]] Place place(std::size_t i)
    {
        const FormulaOp& op = ops_[i];
        const General x = calls_ ? General::r12 : General::rdi;
        if (op.code == FormulaCode::component) return {x, bytes_of(op.a)};
        if (op.code == FormulaCode::constant) return constant(op.value);
        if (op.code == FormulaCode::time) return time();
        if (op.code == FormulaCode::parameter) {
            return {calls_ ? General::r14 : General::rsi, bytes_of(op.a)};
        }
        return {General::rsp, bytes_of(i)};
    }
    [[nodiscard]] Place time() { return {General::rsp, bytes_of(ops_.size())}; }
    /// The register with it, xmm0 where no other has it.
    [[nodiscard]] Xmm loaded(std::size_t i)
    {
        if (const auto found = holder(value(i))) return *found;
        load(xmm0, place(i));
        return xmm0;
    }
    template <class Operation>
    void with(std::size_t i, const Operation& operation)
    {
        if (const auto found = holder(value(i))) return operation(*found);
        operation(place(i));
    }

    void compute(std::size_t i)
    {
        const FormulaOp& op = ops_[i];
        if (op.code <= FormulaCode::constant || op.code == FormulaCode::parameter) return;
        if (const OfTwo function = function_of_two(op.code)) {
            load(xmm1, place(op.b));
            load(xmm0, place(op.a));
            call_function(function);
            return store(place(i), xmm0);
        }
        if (const OfOne function = function_of_one(op.code)) {
            load(xmm0, place(op.a));
            call_function(function);
            return store(place(i), xmm0);
        }
        const Xmm a = loaded(op.a);
        const Xmm out = take();
        switch (op.code) {
            case FormulaCode::add: with(op.b, [&](const auto& b) { add(out, a, b); }); break;
            case FormulaCode::subtract:
                with(op.b, [&](const auto& b) { subtract(out, a, b); });
                break;
            case FormulaCode::multiply:
                with(op.b, [&](const auto& b) { multiply(out, a, b); });
                break;
            case FormulaCode::divide: with(op.b, [&](const auto& b) { divide(out, a, b); }); break;
            case FormulaCode::negate: negate(out, a); break;
            default: square_root(out, a); break;
        }
        store(place(i), out);
        hold(value(i));
    }

    std::span<const FormulaOp> ops_;
    bool calls_;
};

// --- series ---

/// Number of sums of products up to which each is written where it is needed. Otherwise there is
/// one function for each length: code that does not fit into the caches is slow.
constexpr int most_straight_sums = 6;
/// Number of operations from which on they are computed faster side by side.
constexpr std::size_t most_series_operations = 50;

class SeriesEmitter : public Emitter {
public:
    /// @param lanes  motions side by side, 1 or 4; of 4 the time is in memory, as the state is
    SeriesEmitter(std::span<std::uint8_t> buffer, const LazyTape& tape, int lanes)
        : Emitter(buffer, General::r14, lanes),
          of_(tape),
          tape_(tape.tape()),
          n_(static_cast<int>(tape.states())),
          m_(static_cast<int>(tape.guards())),
          columns_(count()),
          slopes_(tape_.ops_count, -1)
    {
        int sums = 0;
        const auto want = [&](int of) {
            int& slope = slopes_[static_cast<std::size_t>(of)];
            if (slope < 0) slope = columns_++;
        };
        for (int i = n_ + 1; i < count(); ++i) {
            const TapeOp& op = at(i);
            if (is_function(op.op) || op.op == TaylorOp::angle) want(op.a);
            if (op.op == TaylorOp::angle) want(op.b);
            if (is_inverse(op.op)) want(i);
            sums += is_sum_of_products(op.op);
        }
        straight_ = sums <= most_straight_sums;
    }

    void emit()
    {
        const int most = of_.is_polynomial() ? of_.degree() : detail::most_taylor_order;
        if (!straight_) emit_sums(most);
        enter((columns_ * stride * each() + 63) / 64 * 64);
        start();
        for (int k = 0; k < most; ++k) {
            for (int i = n_ + 1; i < count(); ++i) compute(i, k);
            for (int j = 0; j < n_; ++j) advance(j, k);
            keep_guards(k);
            if (k + 1 == most) {
                end(k + 1);
            } else if (!of_.is_polynomial() && (k + 1 == 12 || k + 1 == 16)) {
                const std::size_t goes_on = jump_unless(General::r15, k + 1);
                const Held before = held();
                end(k + 1);
                hold_again(before);
                come_here(goes_on);
            }
        }
    }

private:
    static constexpr int stride = 22;  ///< of columns: coefficients 0 to 20, and a factor
    static constexpr int factor = 21;  ///< place of the factor of later coefficients

    [[nodiscard]] static bool is_sum_of_products(TaylorOp op) noexcept
    {
        switch (op) {
            case TaylorOp::product:
            case TaylorOp::square:
            case TaylorOp::quotient:
            case TaylorOp::constant_over: return true;
            default: return op >= TaylorOp::square_root;
        }
    }
    [[nodiscard]] int count() const noexcept { return static_cast<int>(tape_.ops_count); }
    [[nodiscard]] const TapeOp& at(int i) const { return tape_.ops[static_cast<std::size_t>(i)]; }
    [[nodiscard]] int degree(int i) const
    {
        return i < 0 ? 0 : tape_.degree[static_cast<std::size_t>(i)];
    }
    [[nodiscard]] double own_constant(int i) const
    {
        return of_.constants()[static_cast<std::size_t>(i)];
    }
    [[nodiscard]] int slope(int i) const { return slopes_[static_cast<std::size_t>(i)]; }

    // --- the frame ---

    static constexpr std::array saved{General::rbx, General::r12, General::r13, General::r14,
                                      General::r15};

    void enter(int size)
    {
        if (main_at_ != 0) come_here(main_at_);
        push(General::rbp);
        move(General::rbp, General::rsp);
        for (const General each : saved) push(each);
        take_from_stack(size);
        align_stack();
        move(General::rbx, General::rsp);
        if (each() == 8) {
            move(General::r12, General::rdx);
            move(General::r13, General::rcx);
            move(General::r15, General::rsi);
        } else {
            load(xmm0, {General::rdi, 0});
            move(General::rdi, General::rsi);
            move(General::r12, General::rcx);
            move(General::r13, General::r8);
            move(General::r15, General::rdx);
        }
        find_constants();
    }
    void return_with(int order)
    {
        set(General::rax, order);
        if (each() != 8) clear_upper();
        address(General::rsp, {General::rbp, -8 * static_cast<int>(saved.size())});
        for (std::size_t i = saved.size(); i-- > 0;) pop(saved[i]);
        pop(General::rbp);
        leave();
    }

    // --- places ---

    [[nodiscard]] Place place(const Value& value)
    {
        return {General::rbx, each() * (value.of * stride + value.k)};
    }
    /// Coefficients beyond a degree are zeros, as in the rows of the interpreter.
    [[nodiscard]] bool is_zero(const Value& value) const
    {
        return value.of < count() && value.k != factor && value.k > degree(value.of);
    }
    template <class Operation>
    void with(const Value& value, const Operation& operation)
    {
        if (is_zero(value)) return operation(constant(0.0));
        if (const auto found = holder(value)) return operation(*found);
        operation(place(value));
    }
    /// The register of a value, or `other` with it.
    [[nodiscard]] Xmm loaded(const Value& value, Xmm other)
    {
        if (const auto found = holder(value)) return *found;
        load(other, is_zero(value) ? constant(0.0) : place(value));
        return other;
    }
    /// out = a b
    void product(Xmm out, const Value& a, const Value& b)
    {
        if (holder(b) && !holder(a)) return product(out, b, a);
        const Xmm left = loaded(a, out);
        with(b, [&](const auto& right) { multiply(out, left, right); });
    }

    // --- sums ---

    /// out = the sum of a_j b_{k-j} for j from lo to hi, in the order of `reversed_product`
    void convolve(Xmm out, int a, int b, int k, int lo, int hi)
    {
        if (hi < lo) return load(out, constant(0.0));
        const int last = hi - lo;
        if (!straight_ && last >= 3) {
            address(General::rax, place({a, lo}));
            address(General::rcx, place({b, k - lo}));
            call(sums_[static_cast<std::size_t>(last)]);
            move(out, xmm0);
            return;
        }
        for (int i = 0; i <= last; ++i) {
            const int j = lo + detail::outward(0, last, i);
            if (i == 0) {
                product(out, {a, j}, {b, k - j});
            } else {
                product(xmm0, {a, j}, {b, k - j});
                add(out, out, xmm0);
            }
        }
    }
    /// Writes a function for each length of a sum, before the main one.
    void emit_sums(int most)
    {
        main_at_ = jump();
        for (int last = 3; last <= most; ++last) {
            sums_[static_cast<std::size_t>(last)] = size();
            for (int i = 0; i <= last; ++i) {
                const int j = detail::outward(0, last, i);
                const Xmm to = i == 0 ? xmm0 : xmm1;
                load(to, {General::rax, each() * j});
                multiply(to, to, Place{General::rcx, -each() * j});
                if (i > 0) add(xmm0, xmm0, xmm1);
            }
            leave();
        }
    }
    /// out = the sum of a_j a_{k-j} for j from lo to k - lo
    void square(Xmm out, int a, int k, int lo)
    {
        const bool twice = lo <= (k - 1) / 2 && k > 0;
        const bool middle = k % 2 == 0 && lo <= k / 2;
        if (twice) {
            convolve(out, a, a, k, lo, (k - 1) / 2);
            add(out, out, out);
        }
        if (middle) {
            const Xmm to = twice ? xmm0 : out;
            product(to, {a, k / 2}, {a, k / 2});
            if (twice) add(out, out, to);
        }
        if (!twice && !middle) load(out, constant(0.0));
    }
    /// out = the sum of ((exponent + 1) j / k - 1) a_j p_{k-j} for j from 1 to hi
    void power(Xmm out, int i, int k, int hi)
    {
        if (hi < 1) return load(out, constant(0.0));
        const TapeOp& op = at(i);
        const double each = (op.exponent + 1) / k;
        for (int j = 1; j <= hi; ++j) {
            const Xmm to = j == 1 ? out : xmm0;
            load(to, constant(each * j - 1));
            with({op.a, j}, [&](const auto& a) { multiply(to, to, a); });
            with({i, k - j}, [&](const auto& p) { multiply(to, to, p); });
            if (j > 1) add(out, out, to);
        }
    }

    // --- rows ---

    void start()
    {
        store(place({n_, 0}), xmm0);  // the time
        load(xmm0, constant(1.0));
        store(place({n_, 1}), xmm0);
        if (slope(n_) >= 0) store(place({slope(n_), 1}), xmm0);
        for (int i = 0; i < n_; ++i) {
            const Xmm x = take();
            load(x, {General::rdi, each() * i});
            store(place({i, 0}), x);
            store({General::r12, each() * i}, x);
            hold({i, 0});
        }
    }

    void compute(int i, int k)
    {
        if (of_.is_absorbed(static_cast<std::size_t>(i)) || k > degree(i)) return;
        if (k == 0 && calls(i)) return;
        const Xmm out = take();
        const auto& terms = of_.terms()[static_cast<std::size_t>(i)];
        if (!terms.empty()) {
            combine(out, terms, k);
        } else if (k == 0) {
            begin(out, i);
        } else {
            coefficient(out, i, k);
        }
        store(place({i, k}), out);
        hold({i, k});
        keep_slope(i, k, out);
    }
    /// Keeps k times a coefficient where later ones ask for it.
    void keep_slope(int i, int k, Xmm of)
    {
        if (k == 0 || slope(i) < 0) return;
        multiply(xmm0, of, constant(k));
        store(place({slope(i), k}), xmm0);
    }

    void combine(Xmm out, const std::vector<LazyTape::Term>& terms, int k)
    {
        bool first = true;
        for (const LazyTape::Term& term : terms) {
            const Value value{static_cast<int>(term.of), k};
            if (!first && term.factor == 1) {
                with(value, [&](const auto& from) { add(out, out, from); });
            } else if (!first && term.factor == -1) {
                with(value, [&](const auto& from) { subtract(out, out, from); });
            } else {
                const Xmm to = first ? out : xmm0;
                multiply(to, loaded(value, to), constant(term.factor));
                if (!first) add(out, out, to);
            }
            first = false;
        }
    }

    /// x_{k+1} = f_k / (k + 1)
    void advance(int j, int k)
    {
        const int rate = tape_.outputs[static_cast<std::size_t>(j)];
        const Xmm next = take();
        const Xmm from = loaded({rate, k}, next);
        divide(next, from, constant(k + 1));
        store(place({j, k + 1}), next);
        store({General::r12, each() * ((k + 1) * n_ + j)}, next);
        hold({j, k + 1});
        keep_slope(j, k + 1, next);
    }
    void keep_guards(int k)
    {
        for (int j = 0; j < m_; ++j) {
            const int guard = tape_.outputs[static_cast<std::size_t>(n_ + j)];
            const Xmm value = loaded({guard, k}, xmm0);
            store({General::r13, each() * (k * m_ + j)}, value);
        }
    }
    void end(int order)
    {
        for (int i = n_ + 1; i < count() && m_ > 0; ++i) {
            if (tape_.for_guards[static_cast<std::size_t>(i)]) compute(i, order);
        }
        keep_guards(order);
        return_with(order);
    }

    // --- values ---

    /// The value of an operation by a function; false where it is computed otherwise.
    [[nodiscard]] bool calls(int i)
    {
        const TapeOp& op = at(i);
        const bool of_two = op.op == TaylorOp::power || op.op == TaylorOp::angle;
        const OfOne one = function_of_one(op.op);
        if (!one && !of_two) return false;
        if (op.op == TaylorOp::power) load(xmm1, constant(op.exponent));
        if (op.op == TaylorOp::angle) load(xmm1, place({op.b, 0}));
        load(xmm0, place({op.a, 0}));
        if (of_two) {
            call_function(op.op == TaylorOp::power ? static_cast<OfTwo>(std::pow)
                                                   : static_cast<OfTwo>(std::atan2));
        } else {
            call_function(one);
        }
        store(place({i, 0}), xmm0);
        switch (op.op) {
            case TaylorOp::power:
            case TaylorOp::cube_root:
            case TaylorOp::logarithm: keep_ratio(i, 1, op.a); break;
            case TaylorOp::arc_sine:
            case TaylorOp::arc_cosine:
            case TaylorOp::arc_tangent: keep_ratio(i, 1, op.b); break;
            case TaylorOp::angle: keep_ratio(i, 1, op.c); break;
            default: break;
        }
        return true;
    }
    /// The factor of the later coefficients: c over the value of a series.
    void keep_ratio(int i, double c, int of)
    {
        load(xmm0, constant(c));
        with({of, 0}, [&](const auto& a) { divide(xmm0, xmm0, a); });
        store(place({i, factor}), xmm0);
    }

    void begin(Xmm out, int i)
    {
        const TapeOp& op = at(i);
        const Value a{op.a, 0}, b{op.b, 0};
        const auto by_constant = [&](const auto& operation) {
            load(out, constant(own_constant(i)));
            with(a, operation);
        };
        switch (op.op) {
            case TaylorOp::constant: load(out, constant(own_constant(i))); break;
            case TaylorOp::sum: sum(out, a, b); break;
            case TaylorOp::difference: difference(out, a, b); break;
            case TaylorOp::negative: negate(out, loaded(a, out)); break;
            case TaylorOp::product: product(out, a, b); break;
            case TaylorOp::square: product(out, a, a); break;
            case TaylorOp::quotient:
                keep_ratio(i, 1, op.b);
                with(b,
                     [&, left = loaded(a, out)](const auto& right) { divide(out, left, right); });
                break;
            case TaylorOp::plus_constant:
                by_constant([&](const auto& from) { add(out, out, from); });
                break;
            case TaylorOp::minus_constant:
                subtract(out, loaded(a, out), constant(own_constant(i)));
                break;
            case TaylorOp::constant_minus:
                by_constant([&](const auto& from) { subtract(out, out, from); });
                break;
            case TaylorOp::times_constant:
            case TaylorOp::over_constant:
                by_constant([&](const auto& from) { multiply(out, out, from); });
                break;
            case TaylorOp::constant_over:
                keep_ratio(i, -1, op.a);
                by_constant([&](const auto& from) { divide(out, out, from); });
                break;
            default: {  // a square root
                const Xmm from = loaded(a, out);
                square_root(out, from);
                load(xmm0, constant(0.5));
                divide(xmm0, xmm0, out);
                store(place({i, factor}), xmm0);
            }
        }
    }
    void sum(Xmm out, const Value& a, const Value& b)
    {
        const Xmm left = loaded(a, out);
        with(b, [&](const auto& right) { add(out, left, right); });
    }
    void difference(Xmm out, const Value& a, const Value& b)
    {
        const Xmm left = loaded(a, out);
        with(b, [&](const auto& right) { subtract(out, left, right); });
    }

    // --- later coefficients ---

    void coefficient(Xmm out, int i, int k)
    {
        const TapeOp& op = at(i);
        const int upto_a = std::min(degree(op.a), k), upto_b = std::min(degree(op.b), k);
        const Value a{op.a, k}, b{op.b, k};
        switch (op.op) {
            case TaylorOp::sum: return sum(out, a, b);
            case TaylorOp::difference: return difference(out, a, b);
            case TaylorOp::negative:
            case TaylorOp::constant_minus: return negate(out, loaded(a, out));
            case TaylorOp::plus_constant:
            case TaylorOp::minus_constant:
                if (const Xmm from = loaded(a, out); from != out) move(out, from);
                return;
            case TaylorOp::times_constant:
            case TaylorOp::over_constant:
                multiply(out, loaded(a, out), constant(own_constant(i)));
                return;
            case TaylorOp::product:
                return convolve(out, op.a, op.b, k, std::max(0, k - degree(op.b)), upto_a);
            case TaylorOp::square: return square(out, op.a, k, std::max(0, k - degree(op.a)));
            case TaylorOp::quotient:
                convolve(out, op.b, i, k, 1, upto_b);
                return take_from(out, a, i);
            case TaylorOp::constant_over:
                convolve(out, op.a, i, k, 1, upto_a);
                multiply(out, out, place({i, factor}));
                return;
            case TaylorOp::square_root: square(out, i, k, 1); return take_from(out, a, i);
            case TaylorOp::power:
            case TaylorOp::cube_root:
                power(out, i, k, upto_a);
                multiply(out, out, place({i, factor}));
                return;
            default: break;
        }
        if (is_function(op.op)) return function(out, i, k);
        inverse(out, i, k);
    }
    /// out = (a - out) times the factor
    void take_from(Xmm out, const Value& a, int i)
    {
        subtract(out, loaded(a, xmm0), out);
        multiply(out, out, place({i, factor}));
    }
    /// g' = f(a) a'
    void function(Xmm out, int i, int k)
    {
        const TapeOp& op = at(i);
        const int f = op.op == TaylorOp::exponential ? i : op.b;
        convolve(out, slope(op.a), f, k, 1, std::min(degree(op.a), k));
        divide(out, out, constant(k));
        if (op.op == TaylorOp::cosine) negate(out, out);
        if (op.op == TaylorOp::tangent) add(out, loaded({op.a, k}, xmm0), out);
        if (op.op == TaylorOp::hyperbolic_tangent) subtract(out, loaded({op.a, k}, xmm0), out);
    }
    /// f(a) g' = a'
    void inverse(Xmm out, int i, int k)
    {
        const TapeOp& op = at(i);
        const int da = degree(op.a), db = degree(op.b);
        if (op.op == TaylorOp::angle) return angle(out, i, k);
        const bool of_a = op.op == TaylorOp::logarithm;
        convolve(out, slope(i), of_a ? op.a : op.b, k, std::max(1, k - (of_a ? da : db)), k - 1);
        divide(out, out, constant(k));
        if (op.op != TaylorOp::arc_cosine) return take_from(out, {op.a, k}, i);
        multiply(xmm0, loaded({op.a, k}, xmm0), constant(-1));
        subtract(out, xmm0, out);
        multiply(out, out, place({i, factor}));
    }
    /// c g' = a' b - b' a
    void angle(Xmm out, int i, int k)
    {
        const TapeOp& op = at(i);
        const int da = degree(op.a), db = degree(op.b);
        convolve(out, slope(op.a), op.b, k, std::max(1, k - db), std::min(da, k));
        store(place({i, k}), out);
        convolve(out, slope(op.b), op.a, k, std::max(1, k - da), std::min(db, k));
        load(xmm0, place({i, k}));
        subtract(out, xmm0, out);
        store(place({i, k}), out);
        convolve(out, slope(i), op.c, k, std::max(1, k - degree(op.c)), k - 1);
        load(xmm0, place({i, k}));
        subtract(out, xmm0, out);
        multiply(out, out, place({i, factor}));
        divide(out, out, constant(k));
    }

    const LazyTape& of_;
    const LazyTape::Tape& tape_;
    int n_, m_;
    int columns_;
    std::vector<int> slopes_;  ///< columns of the slopes of operations, or -1
    bool straight_ = true;
    std::size_t main_at_ = 0;                                        ///< the jump to the function
    std::array<std::size_t, detail::most_taylor_order + 1> sums_{};  ///< functions by last term
};

[[nodiscard]] std::vector<std::uint8_t>& scratch()
{
    constexpr std::size_t most_bytes = 1 << 18;
    thread_local std::vector<std::uint8_t> bytes(most_bytes);
    return bytes;
}

}  // namespace

MachineCode code_of_values(std::span<const FormulaOp> ops,
                           std::span<const std::size_t> outputs) noexcept
{
    if (!may_make_code()) return {};
    try {
        ValuesEmitter emitter(scratch(), ops);
        emitter.emit(outputs);
        return emitter.finish();
    } catch (...) {  // there is not enough memory, or too much code
        return {};
    }
}

namespace {

MachineCode series_of(const LazyTape& tape, int lanes) noexcept
{
    if (!may_make_code() || tape.operations() > most_series_operations) return {};
    try {
        SeriesEmitter emitter(scratch(), tape, lanes);
        emitter.emit();
        return emitter.finish();
    } catch (...) {
        return {};
    }
}

}  // namespace

MachineCode code_of_series(const LazyTape& tape) noexcept
{
    return series_of(tape, 1);
}

MachineCode code_of_lanes(const LazyTape& tape) noexcept
{
    const auto& ops = tape.tape().ops;
    const bool has_calls = std::ranges::any_of(ops, [](const TapeOp& op) {
        return function_of_one(op.op) || op.op == TaylorOp::power || op.op == TaylorOp::angle;
    });
    if (has_calls || !__builtin_cpu_supports("avx2")) return {};
    return series_of(tape, 4);
}

#else

MachineCode::MachineCode(std::span<const unsigned char> /*bytes*/) noexcept {}
MachineCode::~MachineCode() = default;
bool may_make_code() noexcept
{
    return false;
}
MachineCode code_of_values(std::span<const FormulaOp> /*ops*/,
                           std::span<const std::size_t> /*outputs*/) noexcept
{
    return {};
}
MachineCode code_of_series(const detail::LazyTape& /*tape*/) noexcept
{
    return {};
}
MachineCode code_of_lanes(const detail::LazyTape& /*tape*/) noexcept
{
    return {};
}

#endif

}  // namespace ricochet::python
