// A reference to something that can be called, for functions that are compiled once.
#pragma once

namespace ricochet::detail {

template <class Signature>
class FunctionRef;

/// Refers to a function object, which has to outlive it.
template <class Result, class... Arguments>
class FunctionRef<Result(Arguments...)> {
public:
    template <class Function>
    FunctionRef(const Function& function) noexcept
        : function_(&function), call_([](const void* called, Arguments... arguments) -> Result {
              return (*static_cast<const Function*>(called))(arguments...);
          })
    {
    }
    Result operator()(Arguments... arguments) const { return call_(function_, arguments...); }

private:
    const void* function_;
    Result (*call_)(const void*, Arguments...);
};

}  // namespace ricochet::detail
