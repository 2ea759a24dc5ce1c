// Internal: the declarations of this header may change without notice.
//
// The state of the loop for systems of one to four components.
#pragma once

#include <array>
#include <cstddef>

namespace ricochet::detail {

/// One to four doubles, with zeros behind the last. Loops over components go over all four: a zero
/// changes no sum, maximum or comparison, so that the loop is compiled once and has the bits of a
/// loop over the components alone. `size` and the iterators are those of the components.
class SmallState {
public:
    using value_type = double;
    static constexpr std::size_t room = 4;

    SmallState() = default;
    explicit SmallState(std::size_t size) noexcept : size_(size) {}

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    /// Takes the number of components of `other`.
    void resize_like(const SmallState& other) noexcept { size_ = other.size_; }

    [[nodiscard]] double* data() noexcept { return values_.data(); }
    [[nodiscard]] const double* data() const noexcept { return values_.data(); }
    [[nodiscard]] double& operator[](std::size_t i) noexcept { return values_[i]; }
    [[nodiscard]] double operator[](std::size_t i) const noexcept { return values_[i]; }

    [[nodiscard]] double* begin() noexcept { return data(); }
    [[nodiscard]] double* end() noexcept { return data() + size_; }
    [[nodiscard]] const double* begin() const noexcept { return data(); }
    [[nodiscard]] const double* end() const noexcept { return data() + size_; }

    friend bool operator==(const SmallState&, const SmallState&) = default;

private:
    std::array<double, room> values_{};
    std::size_t size_ = 0;
};

}  // namespace ricochet::detail
