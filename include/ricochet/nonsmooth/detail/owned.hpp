// Internal: the declarations of this header may change without notice.
//
// A value of a class that is known only by its base.
#pragma once

#include <memory>

namespace ricochet::detail {

/// Owner of a `Base`; a copy owns a clone.
template <class Base>
class Owned {
public:
    explicit Owned(const Base& value) : value_(value.clone()) {}
    Owned(const Owned& other) : Owned(*other) {}
    Owned(Owned&&) noexcept = default;
    Owned& operator=(Owned other) noexcept
    {
        value_.swap(other.value_);
        return *this;
    }
    ~Owned() = default;

    [[nodiscard]] const Base& operator*() const noexcept { return *value_; }
    [[nodiscard]] const Base* operator->() const noexcept { return value_.get(); }

private:
    std::unique_ptr<const Base> value_;
};

}  // namespace ricochet::detail
