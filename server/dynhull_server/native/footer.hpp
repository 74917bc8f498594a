// The footer of a Parquet file with a few of its groups of rows: `_with_groups` of storage/segments/parquet.py. To know
// one group takes a reader of all as long as to read it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace dynhull_server {

// Reads Thrift's compact protocol, and passes over most of it. Once something does not fit, everything is empty.
class Compact {
 public:
  enum Type : std::uint8_t { STOP, TRUE, FALSE, BYTE, I16, I32, I64, DOUBLE, BINARY, LIST, SET, MAP, STRUCT };

  explicit Compact(std::string_view data) : data_(data) {}

  bool failed() const { return failed_; }
  std::size_t place() const { return place_; }

  // Goes to the next field of a struct, whose number is `field`; STOP after the last.
  Type next(std::int64_t& field) {
    const std::uint8_t head = byte();
    if ((head & 15) == STOP || failed_) return STOP;
    field = head >> 4 ? field + (head >> 4) : integer();
    return Type(head & 15);
  }

  struct List {
    Type type;
    std::uint64_t size;
  };
  List list() {
    const std::uint8_t head = byte();
    const std::uint64_t size = head >> 4 == 15 ? varint() : head >> 4;
    if (size > data_.size()) failed_ = true;  // each element takes a byte
    return {Type(head & 15), failed_ ? 0 : size};
  }

  std::int64_t integer() {
    const std::uint64_t value = varint();
    return static_cast<std::int64_t>(value >> 1) ^ -static_cast<std::int64_t>(value & 1);
  }

  std::string_view binary() {
    const std::uint64_t size = varint();
    if (size > data_.size() - place_) failed_ = true;
    if (failed_) return {};
    place_ += size;
    return data_.substr(place_ - size, size);
  }

  void skip(Type type, unsigned depth = 0) {
    if (depth > DEEPEST) failed_ = true;
    if (failed_) return;
    switch (type) {
      case TRUE:
      case FALSE: return;
      case BYTE: byte(); return;
      case I16:
      case I32:
      case I64: varint(); return;
      case BINARY: binary(); return;
      case LIST:
      case SET: {
        const List found = list();
        const bool flags = found.type == TRUE || found.type == FALSE;  // a byte each
        for (std::uint64_t number = 0; number < found.size && !failed_; ++number)
          skip(flags ? BYTE : found.type, depth + 1);
        return;
      }
      case STRUCT: {
        std::int64_t field = 0;
        for (Type inner; (inner = next(field)) != STOP;) skip(inner, depth + 1);
        return;
      }
      default: failed_ = true;  // doubles and maps, which no footer has
    }
  }

 private:
  static constexpr unsigned DEEPEST = 16;

  std::uint8_t byte() {
    if (place_ == data_.size()) failed_ = true;
    return failed_ ? 0 : static_cast<std::uint8_t>(data_[place_++]);
  }

  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const std::uint8_t next = byte();
      value |= std::uint64_t(next & 127) << shift;
      if (next < 128) return value;
    }
    failed_ = true;
    return 0;
  }

  std::string_view data_;
  std::size_t place_ = 0;
  bool failed_ = false;
};

// Where the groups of rows of a footer lie, and what they say of one column.
struct Footer {
  struct Group {
    std::size_t end = 0;
    std::optional<std::string_view> least, greatest;
    std::int64_t nulls = 0;
  };
  std::size_t list = 0, first = 0;  // where the list of groups begins, and the first of them
  std::vector<Group> groups;

  // None if it is no footer, or has something unexpected.
  static std::optional<Footer> of(std::string_view data, std::uint64_t column) {
    Compact in(data);
    Footer footer;
    std::int64_t field = 0;
    for (Compact::Type type; (type = in.next(field)) != Compact::STOP;) {
      if (field != ROW_GROUPS || type != Compact::LIST) {
        in.skip(type);
        continue;
      }
      footer.list = in.place();
      const Compact::List found = in.list();
      footer.first = in.place();
      if (found.type != Compact::STRUCT) return {};
      for (std::uint64_t number = 0; number < found.size && !in.failed(); ++number) {
        Group& group = footer.groups.emplace_back();
        read_group(in, column, group);
        group.end = in.place();
      }
    }
    if (in.failed() || !footer.first) return {};
    return footer;
  }

 private:
  // The numbers of fields in parquet.thrift.
  enum { ROW_GROUPS = 4, COLUMNS = 1, META_DATA = 3, STATISTICS = 12, NULLS = 3, GREATEST = 5, LEAST = 6 };

  static void read_group(Compact& in, std::uint64_t column, Group& group) {
    std::int64_t field = 0;
    for (Compact::Type type; (type = in.next(field)) != Compact::STOP;) {
      if (field != COLUMNS || type != Compact::LIST) {
        in.skip(type);
        continue;
      }
      const Compact::List columns = in.list();
      for (std::uint64_t number = 0; number < columns.size && !in.failed(); ++number) {
        if (number == column && columns.type == Compact::STRUCT)
          read_inner(in, META_DATA, [&] { read_inner(in, STATISTICS, [&] { read_statistics(in, group); }); });
        else
          in.skip(columns.type);
      }
    }
  }

  // Calls `read` for one field of a struct, which is a struct, and passes over the others.
  template <class Read>
  static void read_inner(Compact& in, std::int64_t wanted, const Read& read) {
    std::int64_t field = 0;
    for (Compact::Type type; (type = in.next(field)) != Compact::STOP;)
      if (field == wanted && type == Compact::STRUCT)
        read();
      else
        in.skip(type);
  }

  static void read_statistics(Compact& in, Group& group) {
    std::int64_t field = 0;
    for (Compact::Type type; (type = in.next(field)) != Compact::STOP;) {
      if (field == NULLS && type == Compact::I64)
        group.nulls = in.integer();
      else if (field == GREATEST && type == Compact::BINARY)
        group.greatest = in.binary();
      else if (field == LEAST && type == Compact::BINARY)
        group.least = in.binary();
      else
        in.skip(type);
    }
  }
};

}  // namespace dynhull_server
