// Internal: the declarations of this header may change without notice.
//
// Owners of objects. They stand for std::unique_ptr and std::shared_ptr, whose header reads streams
// and takes a tenth of the time in which a short program compiles.
#pragma once

#include <atomic>
#include <cstddef>
#include <utility>

namespace ricochet::detail {

/// Deletes its object, if it has one.
template <class T>
class Owner {
public:
    Owner() = default;
    explicit Owner(T* object) noexcept : object_(object) {}
    Owner(Owner&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
    Owner& operator=(Owner other) noexcept
    {
        std::swap(object_, other.object_);
        return *this;
    }
    ~Owner() { delete object_; }

    [[nodiscard]] T& operator*() const noexcept { return *object_; }
    [[nodiscard]] T* operator->() const noexcept { return object_; }
    [[nodiscard]] explicit operator bool() const noexcept { return object_ != nullptr; }

private:
    T* object_ = nullptr;
};

/// An object, or none, that does not change, and that all copies share, on any threads.
/// @tparam T  may be void
template <class T>
class Shared {
    struct Counted {
        void (*destroy)(Counted* self);
        std::atomic<std::size_t> owners = 1;
    };
    template <class Object>
    struct Holder : Counted {
        template <class... Arguments>
        explicit Holder(Arguments&&... arguments)
            : Counted{[](Counted* self) { delete static_cast<Holder*>(self); }},
              object(std::forward<Arguments>(arguments)...)
        {
        }
        const Object object;
    };

public:
    Shared() = default;
    Shared(const Shared& other) noexcept : counted_(other.counted_), object_(other.object_)
    {
        if (counted_) counted_->owners.fetch_add(1, std::memory_order_relaxed);
    }
    Shared(Shared&& other) noexcept
        : counted_(std::exchange(other.counted_, nullptr)),
          object_(std::exchange(other.object_, nullptr))
    {
    }
    Shared& operator=(Shared other) noexcept
    {
        std::swap(counted_, other.counted_);
        std::swap(object_, other.object_);
        return *this;
    }
    ~Shared()
    {
        if (counted_ && counted_->owners.fetch_sub(1, std::memory_order_acq_rel) == 1) {
            counted_->destroy(counted_);
        }
    }

    template <class Object = T, class... Arguments>
    [[nodiscard]] static Shared make(Arguments&&... arguments)
    {
        auto* const holder = new Holder<Object>(std::forward<Arguments>(arguments)...);
        Shared made;
        made.counted_ = holder;
        made.object_ = &holder->object;
        return made;
    }

    [[nodiscard]] const T* get() const noexcept { return object_; }
    [[nodiscard]] const T* operator->() const noexcept { return object_; }

private:
    Counted* counted_ = nullptr;
    const T* object_ = nullptr;
};

}  // namespace ricochet::detail
