/* SpscRing of spsc_ring.h, with the names used there. Runs are endless: indices count modulo 4 N, which is exact
 * because all differences the code forms are at most N. Memory: see weak_memory.pml.
 *
 * Checked: the slot that one side works on is never open to the other, and no access to it is a race (so nothing is
 * torn); elements arrive in order, each once, none missing; claim() refuses exactly when the ring is full as far as
 * the producer can see, front() exactly when it is empty as far as the consumer can see; a new high-water mark is a
 * fill that the producer sees, and at most N; the ring never stands still while both sides are willing.
 * Left out: the counter of drops, dropped elements (they never enter the ring), 64-bit overflow. */
#ifndef N
#define N 2
#endif
#define SLOTS N
#define THREADS 2
#define kModulo (4 * N)
#define MESSAGES (2 * kModulo) /* one for each value of head, then one for each value of tail */
#include "weak_memory.pml"

#ifndef kPublish
#define kPublish RELEASE
#endif
#ifndef kObserve
#define kObserve ACQUIRE
#endif
#ifndef kRelease
#define kRelease RELEASE
#endif
#ifndef kReclaim
#define kReclaim ACQUIRE
#endif

#define kProducer 0
#define kConsumer 1
#define kBeingWritten 255
#define next(index) (((index) + 1) % kModulo)
#define minus(a, b) (((a) + kModulo - (b)) % kModulo)
#define message_of_head(index) (index)
#define message_of_tail(index) (kModulo + (index))

byte head, tail;                 /* the newest values */
byte head_visible, tail_visible; /* what the other side's next load returns */
byte head_seen, tail_seen;
byte high_water;
byte word[N] = kBeingWritten; /* an element is its index, once it is complete */
bit claimed[N], at_front[N];

/* Stores reach the other side some time. */
active proctype memory() {
  do
  :: atomic { head_visible != head -> head_visible = next(head_visible) }
  :: atomic { tail_visible != tail -> tail_visible = next(tail_visible) }
  od
}

inline load_tail() {
  tail_seen = tail_visible;
  loading(kProducer, message_of_tail(tail_seen), kReclaim)
}

active proctype producer() {
  do
  :: /* claim() */
     atomic {
       if
       :: minus(head, tail_seen) == N -> load_tail()
       :: else
       fi;
       if
       :: minus(head, tail_seen) == N ->
          assert(minus(head, tail_visible) == N);
          goto was_full
       :: else ->
          assert(minus(head, tail) < N && !at_front[head % N]);
          claimed[head % N] = 1
       fi
     };
     /* the element is filled in */
     atomic {
       access(kProducer, head % N, access_of(kConsumer, head % N));
       word[head % N] = kBeingWritten
     };
     atomic {
       access(kProducer, head % N, access_of(kConsumer, head % N));
       word[head % N] = head
     };
     /* publish(): note_fill() ... */
     atomic {
       if
       :: minus(next(head), tail_seen) > high_water ->
          load_tail();
          if
          :: minus(next(head), tail_seen) > high_water ->
             high_water = minus(next(head), tail_seen);
             assert(high_water <= N && high_water == minus(next(head), tail_visible))
          :: else
          fi
       :: else
       fi
     };
     /* ... and the store */
     atomic {
       claimed[head % N] = 0;
       head = next(head);
       storing(kProducer, message_of_head(head), kPublish)
     };
was_full:
     skip
  od
}

active proctype consumer() {
  do
  :: /* front() */
     atomic {
       if
       :: tail == head_seen ->
          head_seen = head_visible;
          loading(kConsumer, message_of_head(head_seen), kObserve)
       :: else
       fi;
       if
       :: tail == head_seen ->
          assert(tail == head_visible);
          goto was_empty
       :: else ->
          assert(tail != head && !claimed[tail % N]);
          at_front[tail % N] = 1
       fi
     };
     /* the element is looked at twice, and is whole and the same both times */
     atomic {
       access(kConsumer, tail % N, access_of(kProducer, tail % N));
       assert(word[tail % N] == tail)
     };
     atomic {
       access(kConsumer, tail % N, access_of(kProducer, tail % N));
       assert(word[tail % N] == tail)
     };
     /* pop() */
     atomic {
       at_front[tail % N] = 0;
       tail = next(tail);
       storing(kConsumer, message_of_tail(tail), kRelease)
     };
was_empty:
     skip
  od
}

/* The tail goes round and round: every element is published, and read. */
ltl always_moves { ([] <> (tail == 0)) && ([] <> (tail == 1)) }
