// The instructions of x86-64 that formulas consist of: arithmetic of doubles in the registers of
// AVX, and what a function needs beside it. (Intel 64 and IA-32 Architectures Software Developer's
// Manual, volume 2, sections 2.1 to 2.3.)
//
// No library writes them, since pip has none, and Xbyak took 134 us for a series of 30 operations,
// where this takes 35.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>

namespace ricochet::python {

/// Registers of whole numbers and addresses, by their numbers in instructions.
enum class General : std::uint8_t {
    rax,
    rcx,
    rdx,
    rbx,
    rsp,
    rbp,
    rsi,
    rdi,
    r8,
    r9,
    r10,
    r11,
    r12,
    r13,
    r14,
    r15
};
/// The register with a double, 0 to 15.
struct Xmm {
    int number;
    friend bool operator==(const Xmm&, const Xmm&) = default;
};
/// A double in memory.
struct Place {
    General base;
    std::int32_t offset;  ///< [bytes]
};

/// Writes instructions one after the other into memory that is not executable.
class Assembler {
public:
    /// @param buffer  keeps its size
    /// @param lanes  doubles side by side in each register and place: 1 or 4
    explicit Assembler(std::span<std::uint8_t> buffer, int lanes = 1) noexcept
        : buffer_(buffer),
          kind_(lanes == 1 ? of_one : of_four),
          whole_kind_(lanes == 1 ? 1 : of_four)
    {
    }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept
    {
        return buffer_.first(size_);
    }

    // --- doubles; the right operand may be in memory ---

    void load(Xmm to, const Place& from) { scalar(0x10, to, {0}, from); }
    void store(const Place& to, Xmm from) { scalar(0x11, from, {0}, to); }
    void move(Xmm to, Xmm from) { vector(0x28, to, {0}, from); }
    template <class Right>
    void add(Xmm to, Xmm left, const Right& right)
    {
        scalar(0x58, to, left, right);
    }
    template <class Right>
    void multiply(Xmm to, Xmm left, const Right& right)
    {
        scalar(0x59, to, left, right);
    }
    template <class Right>
    void subtract(Xmm to, Xmm left, const Right& right)
    {
        scalar(0x5c, to, left, right);
    }
    template <class Right>
    void divide(Xmm to, Xmm left, const Right& right)
    {
        scalar(0x5e, to, left, right);
    }
    void square_root(Xmm to, Xmm of) { scalar(0x51, to, kind_ == of_one ? of : Xmm{0}, of); }
    void exclusive_or(Xmm to, Xmm left, Xmm right) { vector(0x57, to, left, right); }

    // --- addresses and jumps ---

    void push(General of) { general(0x50 + low(of), of); }
    void pop(General to) { general(0x58 + low(to), to); }
    void move(General to, General from) { general_pair(0x89, from, to); }
    void move(General to, std::uint64_t value)
    {
        put(0x48 | int(number(to) > 7));
        put(0xb8 + low(to));
        put_bytes(value);
    }
    /// The lower 32 bits.
    void set(General to, std::int32_t value)
    {
        general(0xb8 + low(to), to);
        put_bytes(value);
    }
    void add_to_stack(std::int32_t bytes) { stack(0xc4, bytes); }
    void take_from_stack(std::int32_t bytes) { stack(0xec, bytes); }
    /// Rounds the stack down to a multiple of 64.
    void align_stack()
    {
        for (const int byte : {0x48, 0x83, 0xe4, 0xc0}) put(byte);
    }
    void address(General to, const Place& of)
    {
        put(0x48 | int(number(to) > 7) << 2 | int(number(of.base) > 7));
        put(0x8d);
        put_place(low(to), of);
    }
    /// Where the address of something is to be written that is not known yet.
    [[nodiscard]] std::size_t address_to_come(General to)
    {
        put(0x48 | int(number(to) > 7) << 2);
        put(0x8d);
        put(low(to) << 3 | 5);
        return to_come();
    }
    void call(General function) { general(0xff, function, 0xd0 + low(function)); }
    void call(std::size_t function)
    {
        put(0xe8);
        come_from(to_come(), function);
    }
    /// Jumps; where to is given by `come_here`.
    [[nodiscard]] std::size_t jump()
    {
        put(0xe9);
        return to_come();
    }
    /// The same if the lower 32 bits differ from a number.
    [[nodiscard]] std::size_t jump_unless(General is, std::int32_t value)
    {
        general(0x81, is, 0xf8 + low(is));
        put_bytes(value);
        put(0x0f);
        put(0x85);
        return to_come();
    }
    void come_here(std::size_t from) { come_from(from, size_); }
    void leave() { put(0xc3); }
    /// Clears the upper halves of the registers, for code that knows no others.
    void clear_upper()
    {
        for (const int byte : {0xc5, 0xf8, 0x77}) put(byte);
    }

    void put_number(double value) { put_bytes(value); }
    void pad_to(std::size_t multiple)
    {
        while (size_ % multiple != 0) put(0x90);
    }

private:
    [[nodiscard]] static int number(General of) noexcept { return static_cast<int>(of); }
    [[nodiscard]] static int low(General of) noexcept { return number(of) & 7; }

    void put(int byte)
    {
        if (size_ == buffer_.size()) throw std::length_error("Assembler: too much code");
        buffer_[size_++] = static_cast<std::uint8_t>(byte);
    }
    template <class T>
    void put_bytes(const T& value)
    {
        if (buffer_.size() - size_ < sizeof value) {
            throw std::length_error("Assembler: too much code");
        }
        std::memcpy(buffer_.data() + size_, &value, sizeof value);
        size_ += sizeof value;
    }

    /// An instruction of one general register, which may be one of the upper eight.
    void general(int opcode, General of, int operand = -1)
    {
        if (number(of) > 7) put(0x41);
        put(opcode);
        if (operand >= 0) put(operand);
    }
    void general_pair(int opcode, General reg, General rm)
    {
        put(0x48 | int(number(reg) > 7) << 2 | int(number(rm) > 7));
        put(opcode);
        put(0xc0 | low(reg) << 3 | low(rm));
    }
    void stack(int operation, std::int32_t bytes)
    {
        put(0x48);
        put(0x81);
        put(operation);
        put_bytes(bytes);
    }

    // Kinds of operands in prefixes: a double, and four of them.
    static constexpr int of_one = 3, of_four = 5;

    /// Prefix VEX, map 0F. @param kind  1: all of 128 bits
    void prefix(int kind, int reg, int left, bool upper_operand)
    {
        const int rest = (~left & 15) << 3 | kind;
        const int upper_reg = reg > 7 ? 0 : 0x80;
        if (!upper_operand) {
            put(0xc5);
            put(upper_reg | rest);
        } else {
            put(0xc4);
            put(upper_reg | 0x41);
            put(rest);
        }
    }
    void put_place(int reg, const Place& of)
    {
        const bool is_short = of.offset >= -128 && of.offset < 128;
        put((is_short ? 0x40 : 0x80) | (reg & 7) << 3 | low(of.base));
        if (low(of.base) == 4) put(0x24);  // rsp and r12 need a second byte
        if (is_short) {
            put(of.offset & 0xff);
        } else {
            put_bytes(of.offset);
        }
    }
    void scalar(int opcode, Xmm reg, Xmm left, const Place& right)
    {
        prefix(kind_, reg.number, left.number, number(right.base) > 7);
        put(opcode);
        put_place(reg.number, right);
    }
    void scalar(int opcode, Xmm reg, Xmm left, Xmm right) { pair(kind_, opcode, reg, left, right); }
    void vector(int opcode, Xmm reg, Xmm left, Xmm right)
    {
        pair(whole_kind_, opcode, reg, left, right);
    }
    void pair(int kind, int opcode, Xmm reg, Xmm left, Xmm right)
    {
        prefix(kind, reg.number, left.number, right.number > 7);
        put(opcode);
        put(0xc0 | (reg.number & 7) << 3 | (right.number & 7));
    }

    /// Leaves out a distance; returns where.
    [[nodiscard]] std::size_t to_come()
    {
        put_bytes(std::int32_t{0});
        return size_ - sizeof(std::int32_t);
    }
    void come_from(std::size_t from, std::size_t to)
    {
        const auto distance = static_cast<std::int32_t>(static_cast<std::ptrdiff_t>(to) -
                                                        static_cast<std::ptrdiff_t>(from + 4));
        std::memcpy(buffer_.data() + from, &distance, sizeof distance);
    }

    std::span<std::uint8_t> buffer_;
    int kind_, whole_kind_;
    std::size_t size_ = 0;
};

}  // namespace ricochet::python
