#pragma once

// A thin owner of SQLite connections and statements: every connection is set up the same safe way,
// every failure is an Error, and a failed fsync stops the process.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace lightkiln {

// A statement borrowed from its connection's cache; reset when it goes out of scope.
class Statement {
 public:
  Statement(sqlite3* db, sqlite3_stmt* statement) : db_(db), statement_(statement) {}
  ~Statement();
  Statement(Statement&& other) noexcept;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  void bind(int index, std::string_view value);
  void bind(int index, int64_t value);
  void bind(int index, uint64_t value) { bind(index, static_cast<int64_t>(value)); }
  void bind(int index, int value) { bind(index, static_cast<int64_t>(value)); }
  void bind(int index, double value);

  // Moves to the next row; false when there is none.
  bool step();

  std::string text(int column) const;
  int64_t integer(int column) const;
  uint64_t natural(int column) const { return static_cast<uint64_t>(integer(column)); }
  double real(int column) const;

 private:
  sqlite3* db_;
  sqlite3_stmt* statement_;
};

class Database {
 public:
  enum class Access { read, write };
  // WAL, synchronous=FULL, no checkpoint of its own, no mmap, foreign keys, untrusted schema,
  // defensive. A read connection refuses to write.
  Database(const std::string& path, Access access);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // `sql` is a literal: the cache is keyed by its address and text.
  template <typename... Values>
  Statement query(const char* sql, const Values&... values) {
    Statement statement = prepare(sql);
    int index = 0;
    (statement.bind(++index, values), ...);
    return statement;
  }
  // Runs a statement to its end; the number of rows it changed.
  template <typename... Values>
  int64_t run(const char* sql, const Values&... values) {
    Statement statement = query(sql, values...);
    while (statement.step()) {
    }
    return changes();
  }
  // The first column of the first row, or `otherwise`.
  template <typename... Values>
  int64_t number(int64_t otherwise, const char* sql, const Values&... values) {
    Statement statement = query(sql, values...);
    return statement.step() ? statement.integer(0) : otherwise;
  }

  void execute(const char* sql);  // several statements, no values
  int64_t changes() const;
  bool in_transaction() const;
  // Pages in the WAL after the last commit of this connection.
  int wal_pages() const { return wal_pages_; }
  // Moves the WAL into the database file as far as readers allow. The caller holds the store's
  // lock.
  void checkpoint();

 private:
  Statement prepare(const char* sql);
  sqlite3* db_ = nullptr;
  int wal_pages_ = 0;
  std::map<std::string_view, sqlite3_stmt*> statements_;
};

// BEGIN IMMEDIATE ... COMMIT; rolls back when it goes out of scope uncommitted.
class Transaction {
 public:
  // With `sync` false the commit reaches the disk with the next one that is synced.
  explicit Transaction(Database& db, bool sync = true);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit();

 private:
  Database& db_;
};

}  // namespace lightkiln
